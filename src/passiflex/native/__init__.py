"""CasADi functions as compiled code: generate C, compile once, call without copies, integrate."""

from passiflex.native.cache import cache_folder as cache_folder
from passiflex.native.compiler import Compiler as Compiler
from passiflex.native.compiler import find_compiler as find_compiler
from passiflex.native.fixed_step import DRIVER as DRIVER
from passiflex.native.fixed_step import Advance as Advance
from passiflex.native.fixed_step import FixedStep as FixedStep
from passiflex.native.fixed_step import Refinement as Refinement
from passiflex.native.fixed_step import Watched as Watched
from passiflex.native.function import NativeFunction as NativeFunction
from passiflex.native.held_loop import HELD_LOOP_DRIVER as HELD_LOOP_DRIVER
from passiflex.native.held_loop import HeldLoop as HeldLoop
from passiflex.native.lane_data import Change as Change
from passiflex.native.lane_data import LaneInputs as LaneInputs
from passiflex.native.lane_data import LaneState as LaneState
from passiflex.native.lane_loop import LaneFunctions as LaneFunctions
from passiflex.native.lane_loop import LaneLoop as LaneLoop
from passiflex.native.library import compile_functions as compile_functions
from passiflex.native.library import compile_source as compile_source
from passiflex.native.library import load_external as load_external
from passiflex.native.loop_state import LoopState as LoopState
from passiflex.native.loop_state import Samples as Samples
from passiflex.native.loop_state import Watch as Watch
from passiflex.native.stability import fastest_pole as fastest_pole
from passiflex.native.stability import stable_step as stable_step
