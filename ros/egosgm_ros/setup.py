# SPDX-License-Identifier: Apache-2.0
from setuptools import setup

setup(
    name="egosgm_ros",
    version="0.1.0",
    packages=["egosgm_ros"],
    package_data={"egosgm_ros": ["fastdds.xml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/egosgm_ros"]),
        ("share/egosgm_ros", ["package.xml"]),
        ("share/egosgm_ros/launch", ["launch/egosgm.launch.py"]),
        ("share/egosgm_ros/rviz", ["rviz/egosgm.rviz"]),
    ],
    install_requires=["setuptools"],  # egosgm's wheel is on no index: whose a package of that name would be, nobody knows
    license="Apache-2.0",
    entry_points={"console_scripts": ["egosgm_node = egosgm_ros.node:main"]},
)
