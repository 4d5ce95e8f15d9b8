"""`vsensor profile new FILE`: a skeleton of a profile, guessed from names, units and comments."""

from vsensor.profile_new.marks import MARK, is_marked
from vsensor.profile_new.new import new_profile
from vsensor.profile_new.skeleton import Skeleton, write_profile

__all__ = ["MARK", "Skeleton", "is_marked", "new_profile", "write_profile"]
