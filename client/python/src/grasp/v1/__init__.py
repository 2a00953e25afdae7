"""The messages and enums of the contract, which the files of `proto/grasp/v1` describe."""

from .error_reason_pb2 import *
from .grasp_pb2 import *
from .grasp_service_pb2 import *
from .grasp_type_pb2 import *
from .hand_rig_service_pb2 import *
from .holdout_pb2 import *
from .object_service_pb2 import *
from .search_pb2 import *
from .track_pb2 import *
