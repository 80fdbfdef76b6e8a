"""The package for colcon."""

from setuptools import setup

NAME = "tautscope_node"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", ["config/node.yaml"]),
        (f"share/{NAME}/launch", ["launch/node.launch.py"]),
    ],
    zip_safe=True,
    maintainer="The tautscope authors",
    maintainer_email="tautscope@example.org",
    description="Hysteresis reduction for flexible endoscopic instruments: a lifecycle node",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"instrument_node = {NAME}.node:main"]},
)
