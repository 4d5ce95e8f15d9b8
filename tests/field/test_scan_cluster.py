"""The same scan on a Dask cluster gives the same rows."""

from tests.field.test_scan_many import SHORT, _write
from vsensor.field.scan import ScanOptions
from vsensor.field.scan_many import scan_logs
from vsensor.field.table import open_table


def test_a_cluster_scans_logs_into_the_same_rows_as_local_processes(tmp_path, scheduler):
    frames = SHORT.frames()
    logs = [tmp_path / "one.log", tmp_path / "two.log"]
    for log in logs:
        _write(log, frames)
    scan_logs(logs, tmp_path / "local", ScanOptions(), workers=1)
    report = scan_logs(logs, tmp_path / "cluster", ScanOptions(), scheduler=scheduler)
    assert not report.failures
    local, cluster = (open_table([tmp_path / name]).scan().collect() for name in ("local", "cluster"))
    assert cluster.equals(local)
