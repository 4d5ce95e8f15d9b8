"""The page: what stands where, and what the server answers; the cursor moves in the browser (assets/)."""

import math
from functools import lru_cache
from pathlib import Path
from typing import Any

from vsensor.apps.examine.drive import Drive
from vsensor.apps.examine.figures import analysis_figure, quality_figure
from vsensor.apps.examine.packed import packed
from vsensor.apps.examine.raw import signal_names
from vsensor.apps.examine.views import FUNCTIONS, SORTS, View, csv_of
from vsensor.errors import ConfigError, MissingExtraError
from vsensor.types import SIDE_NAMES

ASSETS = Path(__file__).parent / "assets"
VIEW_KEYS = ("function", "range", "sort", "sides", "signal")
CONFIG: Any = {"displaylogo": False, "responsive": True, "modeBarButtonsToRemove": ["lasso2d", "select2d"]}


def make_app(drive: Drive) -> Any:
    """Return the Dash application of a drive; raises MissingExtraError without Dash."""
    dash = require_dash()
    app = dash.Dash(
        "vsensor.examine",
        assets_folder=str(ASSETS),
        title=f"{drive.log.name} - vsensor examine",
        update_title=None,
        serve_locally=True,
        compress=False,
    )
    app.layout = _layout(drive)
    _answer(app, drive)
    _serve(app.server, drive)
    return app


def require_dash() -> Any:
    """Return Dash; raises MissingExtraError without it."""
    try:
        import dash
    except ImportError:
        raise MissingExtraError("dash", "apps", "vsensor examine") from None
    return dash


def _layout(drive: Drive) -> Any:
    from dash import dcc, html

    signals = list(signal_names(drive))
    sides = [SIDE_NAMES[side] for side in drive.sides]

    def choice(kind: Any, name: str, options: Any, value: Any, **more: Any) -> Any:
        return html.Div(kind(id=name, options=options, value=value, **more), className=f"choice {name}")

    controls = html.Div(
        [
            choice(dcc.Dropdown, "function", dict(FUNCTIONS), "error", clearable=False, searchable=False),
            html.Label(
                ["at", dcc.Input(id="range", type="number", value=50, min=0, max=250, step=1), "m"],
                className="choice at",
            ),
            choice(dcc.Dropdown, "signal", signals, signals[0] if signals else None, clearable=False),
            choice(dcc.RadioItems, "sort", {k: f"by {v}" for k, v in SORTS.items()}, "time", inline=True),
            choice(dcc.Checklist, "sides", sides, sides, inline=True),
        ],
        className="controls",
    )
    return html.Div(
        [
            html.Header(
                [
                    html.H1(drive.log.name),
                    html.Button(
                        "jump to the largest error", id="largest", title="at the range of the analysis"
                    ),
                    html.Div(id="tools"),
                ]
            ),
            html.Main(
                [
                    html.Section(
                        [html.Div(id="above-tools"), html.Div(id="above"), html.Div(id="overview")],
                        className="left",
                    ),
                    html.Section(
                        [
                            controls,
                            dcc.Graph(id="analysis", config=CONFIG, className="plot"),
                            dcc.Graph(
                                id="quality", figure=quality_figure(drive), config=CONFIG, className="plot"
                            ),
                            html.Div(id="panel"),
                        ],
                        className="right",
                    ),
                ]
            ),
            html.Footer(id="player"),
            html.Div(id="said", role="alert"),
            dcc.Store(id="cursor", data=0),
            dcc.Store(id="found"),
            dcc.Store(id="ready"),
            dcc.Store(id="jumped"),
        ],
        id="examine",
    )


def _answer(app: Any, drive: Drive) -> None:
    from dash import Input, Output, State, ctx, no_update
    from dash.dependencies import ClientsideFunction

    controls = [Input(name, "value") for name in VIEW_KEYS]

    @app.callback(  # type: ignore[untyped-decorator]
        Output("analysis", "figure"),
        Output("said", "children"),
        *controls,
        Input("analysis", "relayoutData"),
        Input("cursor", "data"),
    )
    def analysis(*values: Any) -> Any:
        """Draw the analysis window anew; the cursor matters for one function alone."""
        function, range_m, sort, sides, signal, zoom, number = values
        triggered = {name.split(".")[0] for name in ctx.triggered_prop_ids} if ctx.triggered else set()
        if triggered == {"cursor"} and function != "over_range":
            return no_update, no_update
        is_zoom = triggered == {"analysis"}
        span = _span(zoom)
        if is_zoom and (span is None or function == "over_range"):
            return no_update, no_update
        try:
            view = View.of(drive, function, range_m, sort, sides, signal, number)
        except ConfigError as error:
            return no_update, str(error)
        low, high = span if is_zoom and span is not None else (-math.inf, math.inf)
        return analysis_figure(drive, view, low, high), ""

    @app.callback(  # type: ignore[untyped-decorator]
        Output("found", "data"),
        Input("largest", "n_clicks"),
        State("range", "value"),
        prevent_initial_call=True,
    )
    def find(clicks: Any, range_m: Any) -> Any:
        """Return the image with the largest error."""
        from vsensor.apps.examine.analysis import largest_error

        try:
            view = View.of(drive, "error", range_m, "time", (), None, 0)
        except ConfigError:
            return no_update
        found = largest_error(drive, view.range_m)
        return None if found is None else {"number": found.number, "clicks": clicks}

    app.clientside_callback(ClientsideFunction("examine", "chosen"), Output("ready", "data"), *controls)
    app.clientside_callback(
        ClientsideFunction("examine", "jump"),
        Output("jumped", "data"),
        Input("analysis", "clickData"),
        Input("quality", "clickData"),
        Input("found", "data"),
        prevent_initial_call=True,
    )


def _span(zoom: Any) -> tuple[float, float] | None:
    """Return the stretch of x that was zoomed to, all of it after a reset, None where x was not touched."""
    if not isinstance(zoom, dict):
        return None
    if zoom.get("xaxis.autorange") or zoom.get("autosize"):
        return -math.inf, math.inf
    ends = zoom.get("xaxis.range[0]"), zoom.get("xaxis.range[1]")
    if not all(isinstance(end, int | float) for end in ends):
        return None
    return float(ends[0]), float(ends[1])  # type: ignore[arg-type]


def _serve(server: Any, drive: Drive) -> None:
    """Add the two addresses beside Dash's own: the drive for the browser, and a view as CSV."""
    from flask import Response, request

    @lru_cache(maxsize=1)
    def data() -> bytes:
        return packed(drive)

    @server.get("/drive.bin")  # type: ignore[untyped-decorator]
    def drive_bin() -> Any:
        return Response(data(), mimetype="application/octet-stream")

    @server.get("/view.csv")  # type: ignore[untyped-decorator]
    def view_csv() -> Any:
        asked = request.args
        try:
            view = View.of(
                drive,
                asked.get("function", "error"),
                asked.get("range", "50"),
                asked.get("sort", "time"),
                [side for side in asked.get("sides", "left,right").split(",") if side],
                asked.get("signal"),
                asked.get("image", "0"),
            )
        except ConfigError as error:
            return Response(f"{error}\n", status=400, mimetype="text/plain")
        name = f"{drive.log.stem}_{view.function}.csv"
        headers = {"Content-Disposition": f'attachment; filename="{name}"'}
        return Response(csv_of(drive, view), mimetype="text/csv", headers=headers)
