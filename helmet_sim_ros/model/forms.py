"""A helmet with values changed: refused where its form ignores them; a spring follows its liner."""

from __future__ import annotations

from collections.abc import Mapping

from helmet_sim_ros.errors import Problem, SetupError
from helmet_sim_ros.model.helmet import NO_HELMET, Helmet, Spring
from helmet_sim_ros.model.identified import identified
from helmet_sim_ros.schema import leaf_values

#: Values without effect in a foam helmet, as beginnings of names.
SPRING_ONLY = (
    "spring.", "shell.contact_stiffness", "shell.contact_damping", "shell.contact_returned",
)  # fmt: skip
#: Values of a liner without effect in a helmet whose spring the user gave himself.
FOAM_ONLY = (
    "liner.density", "liner.energy_returned", "liner.columns", "liner.front.density",
    "liner.foam", "liner.inner.", "liner.back.density", "liner.side.density", "liner.top.density",
)  # fmt: skip
#: Values without effect in any spring helmet: its shell is rigid on whatever it strikes.
BENDING = ("shell.material.", "shell.cell")
#: Values with an effect on a bare head.
BARE = ("shell.semi_axes", "shell.center", "shell.contact_")
#: What a spring is identified from.
LINER = ("liner.", "geometry", "shell.semi_axes", "shell.center", "shell.contact_stiffness")


def worn(helmet: Helmet, changes: Mapping[str, object]) -> Helmet:
    """A helmet with values changed by dotted name.

    Raises:
        SetupError: unknown name, a refused value, or a value that has no effect in the helmet's
            form.
    """
    changed: Helmet = helmet.replaced(changes)
    before, after = leaf_values(helmet), leaf_values(changed)
    other = [name for name in changes if before[name] != after[name]]
    if "none" in (helmet.coupling, changed.coupling):
        return _bare(helmet, changed, other, after)
    spring = changed.coupling == "spring"
    given = spring and not helmet.spring.identified
    if not spring:
        _refuse(other, after, SPRING_ONLY, "helmet.coupling is foam; set it to spring")
    else:
        _refuse(other, after, BENDING, "helmet.coupling is spring; set it to foam")
    if given:
        _refuse(
            other, after, FOAM_ONLY,
            "the helmet's file gives its own spring; set helmet.coupling to foam, or leave it",
        )  # fmt: skip
    elif spring and (liner := [name for name in other if name.startswith(LINER)]):
        own = {name: changes[name] for name in other if name.startswith("spring.")}
        fresh = _followed(changed.model_copy(update={"spring": helmet.spring}), liner)
        changed = changed.model_copy(update={"spring": fresh}).replaced(own)
    return changed


def _followed(helmet: Helmet, changed: list[str]) -> Spring:
    """The spring of a changed liner; one that has none is told by the values that were changed."""
    values = leaf_values(helmet)
    try:
        return identified(helmet)
    except SetupError as error:
        (side,) = error.problems
        why = f"no spring follows this liner: {side.key} {side.allowed}; set coupling to foam"
        raise SetupError([Problem(name, values[name], why) for name in changed]) from None


def _bare(
    helmet: Helmet, changed: Helmet, names: list[str], values: Mapping[str, object]
) -> Helmet:
    """A bare head, of which only the shell's shape and contact have an effect."""
    if helmet.coupling != changed.coupling:
        raise SetupError.of(
            "coupling", changed.coupling,
            f"cannot be changed to or from none: choose helmet: {NO_HELMET}, or another helmet",
        )  # fmt: skip
    problems = [
        Problem(name, values[name], "has no effect here: there is no helmet")
        for name in names if not name.startswith(BARE)
    ]  # fmt: skip
    if problems:
        raise SetupError(problems)
    return changed


def _refuse(
    names: list[str], values: Mapping[str, object], ignored: tuple[str, ...], why: str
) -> None:
    problems = [
        Problem(name, values[name], f"has no effect here: {why}")
        for name in names if name.startswith(ignored)
    ]  # fmt: skip
    if problems:
        raise SetupError(problems)
