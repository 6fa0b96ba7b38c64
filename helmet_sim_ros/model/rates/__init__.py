"""Several rates: the body at a large step, head and helmet at the fine one.

A helmet floats on the head: six joint axes lie between them, so the two act on each other by forces
alone. The body without its helmet changes its configuration within milliseconds. Once per large
step H its kinematics, mass matrix M, bias and slow forces are taken at the middle of the step. With
B the Jacobian of the head's twist in head axes, M^-1 B^T tells what a wrench on the head does to
every joint, and A = B M^-1 B^T what it does to the head itself. Then head and helmet are advanced
as rigid bodies at the fine step h, under the same forces as at a single rate:

    head twist x' = B a + (B)' v + A g,   joints v(t) = v0 + a t + M^-1 B^T (integral of g)

with a the acceleration by slow forces and bias, g the wrench of the fine forces on the head. All
of it is of second order in H; in h it is the same leapfrog as the single rate. The joints' damping
D is taken by the trapezoidal rule: M + H D / 2 stands for M, -D v0 for the damping's force. What
that leaves to a and takes from A g depends on H, their sum does not: how a changes from one large
step to the next, its course within the step and the error of H, is told under the same g.

Positions never drift apart: what is integrated at the end are the joints themselves, the head's
pose follows from them anew in each large step, and the helmet's from the head's and its own joints.
"""
