from helmet_sim_ros.mcap_log.reader import ImpactLog as ImpactLog
from helmet_sim_ros.mcap_log.reader import LoggedImpact as LoggedImpact
from helmet_sim_ros.mcap_log.reader import open_log as open_log
from helmet_sim_ros.mcap_log.reader import read_impacts as read_impacts
