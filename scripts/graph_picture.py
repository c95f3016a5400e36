"""Draws the ROS 2 graph, docs/images/ros_graph.svg, from the lists below: python scripts/graph_picture.py."""

from __future__ import annotations

from pathlib import Path

TARGET = Path(__file__).resolve().parents[1] / "docs" / "images" / "ros_graph.svg"
WIDTH, HEIGHT = 900, 470

# name, what it does, x, y, width, height
BOXES = (
    ("simulator_node", "one environment, on topics", 30, 40, 200, 150),
    ("simulator_2 … N", "more of them, for episodes", 30, 330, 200, 90),
    ("tuner_node", "direct random search", 430, 330, 180, 90),
    ("policy_node", "an agent's best action", 670, 40, 200, 150),
    ("you", "ros2 command line", 730, 330, 140, 90),
)
# label, x1, y1, x2, y2, colour
TOPIC, SERVICE = "#1f5f99", "#8a4b08"
ARROWS = (
    ("observation", 230, 60, 670, 60, TOPIC),
    ("joint_states · end_effector/pose", 230, 92, 670, 92, TOPIC),
    ("action | joint_command | target_pose", 670, 128, 230, 128, TOPIC),
    ("finger_command", 670, 160, 230, 160, TOPIC),
    ("~/load_agent", 430, 350, 230, 350, SERVICE),
    ("~/set_parameters_vector", 430, 378, 230, 378, SERVICE),
    ("~/run_episodes", 430, 406, 230, 406, SERVICE),
    ("", 480, 330, 170, 190, SERVICE),
    ("/evaluate · tune", 730, 360, 610, 360, SERVICE),
    ("tuning/progress", 610, 395, 730, 395, TOPIC),
)
NOTES = (
    ("the same three services", 345, 258, SERVICE),
    ("also: /clock, end_effector/twist, end_effector/trace, goal_pose; ~/reset, ~/step", 30, 28, "#444"),
    ("also: status, /diagnostics", 670, 28, "#444"),
    ("also: /diagnostics", 430, 445, "#444"),
    ("blue: topics, brown: services and actions", 30, 445, "#444"),
)


def picture() -> str:
    """The whole drawing as SVG."""
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        "<defs>",
        *(
            f'<marker id="head{i}" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" '
            f'orient="auto"><path d="M0 0L10 5L0 10z" fill="{colour}"/></marker>'
            for i, colour in enumerate((TOPIC, SERVICE))
        ),
        "</defs>",
    ]
    for label, x1, y1, x2, y2, colour in ARROWS:
        head = 0 if colour == TOPIC else 1
        parts.append(
            f'<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" stroke="{colour}" stroke-width="1.6" '
            f'marker-end="url(#head{head})"/>'
        )
        parts.append(_text(label, (x1 + x2) / 2, (y1 + y2) / 2 - 6, colour, anchor="middle", size=11))
    for name, purpose, x, y, width, height in BOXES:
        parts.append(
            f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="8" fill="#f3f6f9" stroke="#33475b"/>'
        )
        parts.append(_text(name, x + width / 2, y + height / 2 - 4, "#111", "middle", 15, bold=True))
        parts.append(_text(purpose, x + width / 2, y + height / 2 + 16, "#444", "middle", 11))
    parts += [_text(text, x, y, colour, "start", 11) for text, x, y, colour in NOTES]
    return "\n".join([*parts, "</svg>", ""])


def _text(text: str, x: float, y: float, colour: str, anchor: str, size: int, bold: bool = False) -> str:
    weight = ' font-weight="bold"' if bold else ""
    return f'<text x="{x:g}" y="{y:g}" fill="{colour}" font-size="{size}" text-anchor="{anchor}"{weight}>{text}</text>'


if __name__ == "__main__":
    TARGET.write_text(picture())
