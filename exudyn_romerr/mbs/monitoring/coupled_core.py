"""The one door to the evaluation of mechanisms as version 0.2 has it, which issues 48 and 49 replace.

Imported where a body asks for the feedback of its mechanism, so that linear bodies and bodies with inputs frozen do
without. What has to be replaced is what stands here.
"""

from ..coupled.coupled_subject import CoupledSubject
from ..coupled.joint_evaluation import Mechanism, why_not_coupled
from ..coupled.other_sensors import OtherSensors

__all__ = ["CoupledSubject", "Mechanism", "OtherSensors", "why_not_coupled"]
