"""Learning an error model from a table: `tune_table` is `vsensor tune`.

survey ──► cells' scales ──► counts ──► surfaces ──► blocks ──► intervals, correlation ──► closed loop
pass 1     local_scale       pass 2     quantiles    pass 3     quantiles, correlation     loop
"""

from vsensor.field.tune.tuned import LEVELS, Tuned, TuneOptions
from vsensor.field.tune.tuning import tune_table

__all__ = ["LEVELS", "TuneOptions", "Tuned", "tune_table"]
