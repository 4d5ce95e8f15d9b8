"""Roads that cannot be are refused in one line that names file and key."""

import pytest

from tests.world.road.made import HEAD, STRAIGHT, line_of, written
from vsensor.cli import main
from vsensor.errors import ConfigError
from vsensor.world.opendrive import load_map

LOOP = (
    'kind = "straight", length_m = 200',
    'kind = "arc", radius_m = 60, turn_deg = 270',
    'kind = "straight", length_m = 200',
)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('schema = "vsensor.road/1"\n', r"missing required field `road`"),
        (HEAD + "line = []", r"road\[0\].line: "),
        (line_of('kind = "straight", length_m = 0'), r"road\[0\].line\[0\].length_m = 0"),
        (line_of('kind = "straight", length_m = -5'), r"road\[0\].line\[0\].length_m = -5"),
        (
            line_of('kind = "straight", length_m = nan'),
            r"road\[0\].line\[0\].length_m = nan: a finite number",
        ),
        (line_of('kind = "arc", radius_m = inf, length_m = 5'), r"line\[0\].radius_m = inf"),
        (line_of('kind = "arc", radius_m = 0.2, length_m = 5'), r"radius_m = 0.2: at least 1 m"),
        (line_of('kind = "arc", radius_m = 20'), r"line\[0\]: an arc has either length_m or turn_deg"),
        (line_of('kind = "curve", length_m = 5'), r"kind = 'curve': arc, bend, clothoid, straight were"),
        (line_of('kind = "straight", lenght_m = 5'), r"lenght_m: unknown key; did you mean length_m"),
        (
            line_of('kind = "bend", radius_m = 90, turn_deg = 20, clothoid_m = 60'),
            r"turn_deg = 20: two cloth",
        ),
        (line_of('kind = "straight", length_m = 9, stretches = true'), r"only a road with closed = true"),
        (line_of(*LOOP), r"road\[0\]: the road crosses itself at s = \d+ m and \d+ m"),
        (
            line_of(
                'kind = "arc", radius_m = 6, length_m = 5', more="left = [{ width_m = 4 }, { width_m = 3 }]"
            ),
            r"road\[0\].line\[0\]: the inner lane folds over: its border lies 7 m inside a bend of 6 m",
        ),
        (STRAIGHT + "right = [{ width_m = -1 }]", r"right\[0\].width_m = -1"),
        (STRAIGHT + "right = [{ width_m = [[0, 3], [9, -1]] }]", r"right\[0\].width_m\[1\]\[1\] = -1"),
        (STRAIGHT + "right = [{ width_m = [[9, 3], [5, 2]] }]", r"width_m: s must rise"),
        (STRAIGHT + "offset_m = [[0, 0], [1e300, 1]]", r"offset_m: s = 1e\+300 m: from 0 to 1e\+06 m"),
        (STRAIGHT + "offset_m = [[5, 0], [5.0001, 1]]", r"offset_m: s must rise by 0.001 m"),
        (STRAIGHT + "offset_m = -1e300", r"offset_m = -1e\+300: at most 1e\+06"),
        (STRAIGHT + 'right = [{ kind = "shoulder" }]', r"road\[0\]: no lane is driven on"),
        (STRAIGHT + "right = [{}, { from_m = 50, to_m = 100 }]", r"right\[1\].taper_m = 60: the lane is 50"),
        (STRAIGHT + "right = [{}, { from_m = 400 }]", r"right\[1\]: from 400 m to 300 m of a road of 300 m"),
        (STRAIGHT + "gap = [{ borders = [-2], at_m = 5, length_m = 1 }]", r"gap\[0\].borders = -2: no such"),
        (
            STRAIGHT + "gap = [{ borders = [-1], at_m = 299, length_m = 5 }]",
            r"gap\[0\]: up to 304 m, but the",
        ),
        (STRAIGHT + "ghost = [{ border = 3, from_m = 0, to_m = 9 }]", r"ghost\[0\].border = 3: no such"),
        (STRAIGHT + "paint = [{ border = 0, from_m = 9, to_m = 9 }]", r"paint\[0\]: from 9 m to 9 m"),
        (STRAIGHT + "centre = { contrast = [[0, 1], [9, 1.5]] }", r"border 0.contrast = 1.5: from 0 to 1"),
        (STRAIGHT + "centre = { kind = 'broken' }", r"centre.kind = 'broken': .*dashed.* were expected"),
        (STRAIGHT + "crosswalk = [{ at_m = 298 }]", r"crosswalk\[0\]: up to 302 m"),
        (
            STRAIGHT + "stop_line = [{ at_m = 50, side = 'left' }]",
            r"stop_line\[0\].at_m = 50: no lane of this",
        ),
        (STRAIGHT + "rough = [{ from_m = 9, to_m = 5, grade = 'A' }]", r"rough\[0\]: from 9 m to 5 m"),
        (STRAIGHT + "bump = [{ at_m = 400 }]", r"bump\[0\]: up to 400.5 m"),
        (STRAIGHT + "elevation = [{ at_m = 9, z_m = 0 }, { at_m = 5, z_m = 1 }]", r"elevation\[1\].at_m = 5"),
        (STRAIGHT + "closed = true", r"closed: its pieces turn by 0 degrees in all, 360"),
        (STRAIGHT + "after = { road = 'nowhere' }", r"after.road = .nowhere.: no such road"),
        (STRAIGHT + "name = 'a'\n" + STRAIGHT.split("\n", 1)[1] + "name = 'a'", r"road\[1\].name = .a.: two"),
        (
            STRAIGHT
            + "name = 'a'\n"
            + STRAIGHT.split("\n", 1)[1]
            + "after = { road = 'a', lanes = [[-4, -1]] }",
            r"road\[1\].after.lanes: there is no lane -4 where the road ends",
        ),
        (
            STRAIGHT + "name = 'a'\n" + STRAIGHT.split("\n", 1)[1] + "after = { road = 'a' }\nx_m = 5",
            r"road\[1\]: x_m, y_m: it starts 295 m from there",
        ),
        (
            STRAIGHT
            + "name = 'a'\n"
            + STRAIGHT.split("\n", 1)[1]
            + "after = { road = 'a' }\nelevation = [{ at_m = 0, z_m = 2 }]",
            r"road\[1\].after: the road goes on 2 m higher",
        ),
        ('schema = "vsensor.road/9"\n', r"schema 'vsensor.road/9' is newer"),
    ],
)
def test_a_road_that_cannot_be_is_refused_by_file_and_key(tmp_path, text, says):
    path = written(tmp_path, text)
    with pytest.raises(ConfigError, match=says) as caught:
        load_map(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_a_road_over_itself_on_a_bridge_is_none_that_crosses_itself(tmp_path):
    more = "elevation = [{ at_m = 150, z_m = 0 }, { at_m = 330, z_m = 6 }]"
    assert load_map(written(tmp_path, line_of(*LOOP, more=more))).warnings == ()


def test_the_command_line_refuses_in_one_line(tmp_path, capsys):
    path = written(tmp_path, line_of('kind = "straight", length_m = 0'))
    assert main(["road", str(path)]) == 2
    assert main(["run", str(path), "--fast"]) == 2
    assert [
        line.startswith(f"vsensor: {path}: road[0].line[0].length_m")
        for line in capsys.readouterr().err.splitlines()
    ] == [True, True]


def test_a_map_is_not_written_where_its_name_says_another_format(tmp_path, capsys):
    path = written(tmp_path, STRAIGHT)
    assert main(["road", str(path), "--out", str(tmp_path / "map.kml")]) == 2
    assert "ends in .xodr" in capsys.readouterr().err
