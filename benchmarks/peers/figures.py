"""What the peers need per step, as measured in `shared/peers/README.md`: one 2-core x86 machine with AVX-512, the first
step left out.
"""

SECONDS = {
    "drop_500": {"stark": {1: 0.0174, 2: 0.0132}, "ipc": {1: 0.0785, 2: 0.0635}},
    "drop_4k": {"stark": {1: 0.242, 2: 0.140}, "ipc": {1: 1.49, 2: 1.19}},
    "drop_20k": {"stark": {1: 2.01, 2: 1.11}, "ipc": {1: 15.5}},
    "twist_1k": {"stark": {1: 0.029}, "ipc": {1: 0.184}},
    "twist_4k": {"stark": {1: 0.139, 2: 0.084}, "ipc": {1: 1.01, 2: 0.82}},
    "twist_20k": {"stark": {1: 0.99, 2: 0.54}, "ipc": {1: 6.70}},
    "blocks": {"stark": {1: 0.227, 2: 0.120}, "ipc": {1: 1.46, 2: 1.15}},
    "twistx_1k": {"stark": {1: 0.130}, "ipc": {1: 0.442}},
}
"""Mean seconds per step: scene -> peer -> number of threads."""

NEWTON = {
    "drop_500": {"stark": 4.6, "ipc": 4.2},
    "drop_4k": {"stark": 6.1, "ipc": 5.4},
    "drop_20k": {"stark": 7.0, "ipc": 4.2},
    "twist_1k": {"stark": 3.0, "ipc": 4.1},
    "twist_4k": {"stark": 3.0, "ipc": 4.6},
    "twist_20k": {"stark": 3.0, "ipc": 3.5},
    "blocks": {"stark": 4.6, "ipc": 5.9},
    "twistx_1k": {"stark": 9.0, "ipc": 8.8},
}
"""Mean Newton iterations per step."""

_BROKEN_OFF = {("drop_20k", "ipc"): 33, ("twist_20k", "ipc"): 20}


def steps(scene: str, peer: str) -> int:
    """The number of steps that a peer's mean is taken over; its last state is at their end."""
    return _BROKEN_OFF.get((scene, peer), 60 if scene == "blocks" else 100)
