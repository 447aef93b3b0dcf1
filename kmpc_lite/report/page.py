"""The page around numbers and pictures: its frame, its style sheet, and what the captions say."""

CAPTIONS = {
    "map": (
        "Map of the drive: obstacles, the robot's path and plans, start and goal",
        "To scale. Circles are the robot at the times beside them, "
        "the line in each points forward. Dashed lines are what the controller "
        "planned at some of those times, each up to its dot.",
    ),
    "commands": (
        "Commanded forward speed and turn rate over time",
        "What was sent to the motors, one step per period. Shaded: "
        "steps whose plan was not simply solved.",
    ),
    "errors": (
        "Distance to the goal, heading error and clearance over time",
        "Both errors must be within the dashed lines for the robot to have arrived. "
        "Clearance is from edge to edge.",
    ),
    "timing": (
        "Time of each control step and its distribution, against the period",
        "Time from pose to command. The first step starts without an earlier plan.",
    ),
    "fit": (
        "Held-out prediction errors of the model and of the nominal unicycle",
        "Smaller is better. The nominal unicycle is the robot that obeys its commands exactly.",
    ),
}
"""Alternative text and caption of each picture."""

MOVING_CAPTION = (
    " Moving obstacles are filled where they start and dotted where they are at the times in them."
)

_CSS = """
:root { color-scheme: light dark; --ink: #1d2327; --soft: #5a6570; --back: #f4f5f6; --card: #ffffff;
  --line: #d9dde1;
  --good: #00694c; --bad: #a63c00; --late: #7a5200; }
@media (prefers-color-scheme: dark) { :root { --ink: #e8eaec; --soft: #a5aeb6; --back: #15181b;
  --card: #1f2428; --line: #383f45;
  --good: #4fd0a8; --bad: #ff9a5c; --late: #f0c056; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--back); color: var(--ink);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 24px 20px 48px; }
h1 { font-size: clamp(1.5rem, 4vw, 2.1rem); line-height: 1.2; margin: 6px 0 8px;
  overflow-wrap: anywhere; }
h2 { font-size: 1.2rem; margin: 0 0 12px; }
.where { color: var(--soft); margin: 0; overflow-wrap: anywhere; }
.badge { display: inline-block; border: 2px solid currentColor; border-radius: 999px;
  padding: 1px 12px; margin-right: 8px; }
.badge { font-weight: 700; }
.good .badge { color: var(--good); } .bad .badge { color: var(--bad); }
  .late .badge { color: var(--late); }
.sentence { font-size: 1.1rem; max-width: 46em; margin: 8px 0 20px; }
.tiles { display: grid; grid-template-columns: repeat(4, 1fr); gap: 10px; margin-bottom: 20px; }
.tile, section { background: var(--card); border: 1px solid var(--line); border-radius: 10px; }
.tile { padding: 10px 14px; display: flex; flex-direction: column; }
.tile strong { font-size: 1.3rem; font-variant-numeric: tabular-nums; }
.name, .note, .small, figcaption { color: var(--soft); font-size: 0.86rem; }
section { padding: 18px 20px; margin-bottom: 20px; min-width: 0; }
.pair, .beside { display: grid; grid-template-columns: 1fr 1fr; gap: 0 20px; align-items: stretch; }
.beside { gap: 0 28px; }
.beside > * { min-width: 0; }
figure { margin: 0; }
.pair figure { margin-bottom: 10px; }
/* the pictures are made for white paper, so they keep it in the dark */
img { display: block; width: 100%; height: auto; background: #ffffff; border-radius: 6px;
  padding: 6px; margin: 0 auto; }
.map img { max-width: 820px; }
.map figcaption { max-width: 820px; margin: 8px auto 0; }
figcaption { margin-top: 8px; }
.scroll { overflow-x: auto; margin-bottom: 14px; }
table { border-collapse: collapse; width: 100%; font-size: 0.94rem; }
th, td { text-align: left; padding: 5px 10px 5px 0; border-bottom: 1px solid var(--line);
  vertical-align: top; overflow-wrap: anywhere; }
tr:last-child > * { border-bottom: none; }
th { font-weight: 600; min-width: 8.5em; }
table:not(.numbers) th { width: 34%; }
.numbers th, .numbers td { font-variant-numeric: tabular-nums; min-width: 5em;
  overflow-wrap: normal; }
pre { overflow-x: auto; background: var(--back); border: 1px solid var(--line); border-radius: 6px;
  padding: 10px 12px; }
pre { font-size: 0.85rem; }
summary { cursor: pointer; font-weight: 600; padding: 4px 0; }
@media (max-width: 760px) {
  .tiles { grid-template-columns: 1fr 1fr; } .pair, .beside { grid-template-columns: 1fr; }
  main { padding: 14px 10px 32px; } section { padding: 12px 10px; } figure { margin-bottom: 10px; }
    img { padding: 0; }
  .tile { padding: 8px 10px; } .tile strong { font-size: 1.12rem; } th { min-width: 6.5em; }
    .numbers th, .numbers td { min-width: 0; }
}
@media print { body { background: #ffffff; } section, .tile { break-inside: avoid;
  border-color: #bbbbbb; } }
"""

PAGE = (
    """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>"""
    + _CSS.replace("{", "{{").replace("}", "}}")
    + """</style>
</head>
<body>
<main>
<header class="{tone}">
<p class="where"><span class="badge">{badge}</span>scenario {scenario}</p>
<h1>{title}</h1>
<p class="sentence">{sentence}</p>
</header>
<div class="tiles">
{tiles}
</div>
<section>
<h2>The drive</h2>
{map}
</section>
<div class="pair">
<section>
<h2>Commands</h2>
{commands}
{statuses}
</section>
<section>
<h2>Errors and clearance</h2>
{errors}
</section>
</div>
<section>
<h2>Step times</h2>
<div class="beside">
{timing}
{times_table}
</div>
</section>
{fit}
<section>
<h2>The robot and its conditions</h2>
{robot_table}
</section>
<section>
<h2>The scenario</h2>
{scenario_table}
<details><summary>The scenario as a file (TOML)</summary><pre>{toml}</pre></details>
</section>
<section>
<h2>How this report was made</h2>
{made}
{kept}
</section>
</main>
</body>
</html>
"""
)
"""With one place for each keyword that `write_report` fills."""
