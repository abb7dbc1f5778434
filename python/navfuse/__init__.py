"""Multisensor navigation from a scenario: INS, DVL, GNSS, depth, odometer and sensors of your own.

>>> import navfuse
>>> scenario = navfuse.Scenario.from_toml(navfuse.QUICKSTART).set("estimator.stop", "100 s")
>>> run = scenario.run()
>>> run.verdict.level
'consistent'
>>> run["ins.velocity"].estimate.shape == (run.time.size, 3)
True

Angles are in degrees where they are shown, vectors along north, east and down, the body forward,
right and down. Quaternions are ``[w, x, y, z]`` and turn a vector of the body into north, east, down.
"""

from navfuse._campaign import Campaign, Shard, merge
from navfuse._errors import DataError, NavfuseError, RunError, ScenarioError
from navfuse._navfuse import __version__
from navfuse._process import Process
from navfuse._run import Epoch, Event, Finding, Innovations, Reason, Run, State, Verdict
from navfuse._scenario import QUICKSTART, Check, Scenario, read_log
from navfuse._sensor import Parameter, Sensor, States
from navfuse._session import Session

__all__ = [
    "QUICKSTART",
    "Campaign",
    "Check",
    "DataError",
    "Epoch",
    "Event",
    "Finding",
    "Innovations",
    "NavfuseError",
    "Parameter",
    "Process",
    "Reason",
    "Run",
    "RunError",
    "Scenario",
    "ScenarioError",
    "Sensor",
    "Session",
    "Shard",
    "State",
    "States",
    "Verdict",
    "__version__",
    "merge",
    "read_log",
]
