from helmet_sim_ros.biomech.evaluation import evaluate as evaluate
from helmet_sim_ros.biomech.record import ImpactRecord as ImpactRecord
from helmet_sim_ros.biomech.result import Evaluation as Evaluation
from helmet_sim_ros.mcap_log.reader import open_log as open_log
from helmet_sim_ros.model.fall.setup import Fall as Fall
from helmet_sim_ros.model.fall.strikes import head_strikes as head_strikes
from helmet_sim_ros.model.rider.properties import Rider as Rider
from helmet_sim_ros.model.setup import ImpactSetup as ImpactSetup
from helmet_sim_ros.model.simulate import simulate as simulate
from helmet_sim_ros.present.comparison import compare as compare
from helmet_sim_ros.study.certification.certify import certify as certify
from helmet_sim_ros.study.optimisation.search import optimise as optimise
from helmet_sim_ros.study.sweeps.sweep import sweep as sweep

__version__: str
