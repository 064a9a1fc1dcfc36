"""Python package of rbpf_svgp_slam; run by catkin_python_setup(), not by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(
    **generate_distutils_setup(
        packages=[
            "rbpf_svgp_slam",
            "rbpf_svgp_slam.bags",
            "rbpf_svgp_slam.charts",
            "rbpf_svgp_slam.checking",
            "rbpf_svgp_slam.display",
            "rbpf_svgp_slam.evaluation",
            "rbpf_svgp_slam.experiments",
            "rbpf_svgp_slam.exports",
            "rbpf_svgp_slam.figures",
            "rbpf_svgp_slam.gmrf",
            "rbpf_svgp_slam.importers",
            "rbpf_svgp_slam.keeper",
            "rbpf_svgp_slam.map_node",
            "rbpf_svgp_slam.maps",
            "rbpf_svgp_slam.metrics",
            "rbpf_svgp_slam.parameters",
            "rbpf_svgp_slam.protocol",
            "rbpf_svgp_slam.recorder",
            "rbpf_svgp_slam.run",
            "rbpf_svgp_slam.simulation",
            "rbpf_svgp_slam.smoothing",
            "rbpf_svgp_slam.survey_area",
            "rbpf_svgp_slam.svgp",
            "rbpf_svgp_slam.svgp.optimizers",
        ],
        package_dir={"": "src"},
        package_data={"rbpf_svgp_slam.evaluation": ["*.j2"]},
    )
)
