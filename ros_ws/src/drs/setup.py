"""Installs the nodes, their launch files and parameter files."""

from setuptools import setup

PACKAGE = "drs"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=[PACKAGE],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/launch", ["launch/panda_reach.launch.py"]),
        (f"share/{PACKAGE}/params", ["params/panda_reach.yaml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The drs authors",
    maintainer_email="drs@example.com",
    description="Simulator, tuner and policy nodes: direct random search of policies over ROS 2.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            *(
                f"{name} = {PACKAGE}.start:{name}"
                for name in ("simulator_node", "tuner_node", "policy_node", "mock_arm_node", "recorder_node")
            ),
            f"bench_rollouts = {PACKAGE}.bench_rollouts:main",
        ]
    },
)
