# SPDX-License-Identifier: Apache-2.0
"""The node's parameters: its own, and every option of the pipeline by its name."""
from typing import Any, Dict, Set

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleNode
from rclpy.parameter import Parameter

import egosgm

OWN = {"device": "", "preset": "default", "max_skew_ms": 0.0, "reliable": False, "auto_start": True, "odom_frame": "odom",
       "publish_tf": False, "motion_frame": "", "tf_wait_s": 0.1, "compressed": False, "max_depth_sigma": 0.1, "point_reasons": "",
       "points_without_moving": False}


class ParameterNode(LifecycleNode):
    """A node whose parameters are those of OWN and the options of the pipeline. They are read when it is configured."""

    _is_configured = False

    def __init__(self, **arguments: Any) -> None:
        super().__init__("egosgm", **arguments)
        for name, value in OWN.items():
            self._declare(name, value)
        try:
            self._of_preset = egosgm.pipeline_options(self._value("preset"))
        except ValueError:  # which on_configure says
            self._of_preset = egosgm.pipeline_options()
        del self._of_preset["preset"]
        for name, value in self._of_preset.items():
            self._declare(name, value)
        for name in self._parameter_overrides:
            if not self.has_parameter(name) and not name.startswith("qos_overrides."):
                raise egosgm.InvalidArgument(f"no parameter named {name}: docs/use/robots.md lists them")
        self._set_later: Set[str] = set()
        self.add_on_set_parameters_callback(self._on_set)

    def _declare(self, name: str, default: Any) -> None:
        """A whole number is a text or a fraction where one is wanted: device:=0, max_skew_ms:=5."""
        given = self._parameter_overrides.get(name)
        if given is not None and type(given.value) is int and type(default) in (str, float):
            self._parameter_overrides[name] = Parameter(name, value=type(default)(given.value))
        self.declare_parameter(name, default)

    def _value(self, name: str) -> Any:
        return self.get_parameter(name).value

    def _options(self) -> Dict[str, Any]:
        """The preset, and over it what the user set."""
        changed = {name: self._value(name) for name, value in self._of_preset.items() if name in self._set_later or self._value(name) != value}
        return {"preset": self._value("preset"), **{name.replace(".", "__"): value for name, value in changed.items()}}

    def _on_set(self, parameters: Any) -> SetParametersResult:
        late = [parameter.name for parameter in parameters if self._is_configured and parameter.name in (*OWN, *self._of_preset)]
        if late:
            return SetParametersResult(successful=False, reason=f"{late[0]} is read when the node is configured: clean it up, set the parameter, configure it again")
        self._set_later.update(parameter.name for parameter in parameters)
        return SetParametersResult(successful=True)

    def _check_parameters(self) -> None:
        """Throws ValueError or RuntimeError."""
        if not 0 <= self._value("tf_wait_s") < np.inf:
            raise ValueError(f"tf_wait_s {self._value('tf_wait_s')}: give how long an image waits for its motion, 0 or more")
        if not 0 <= self._value("max_skew_ms") < np.inf:
            raise ValueError(f"max_skew_ms {self._value('max_skew_ms')}: give 0 for equal stamps, or how far they may differ")
        if not self._value("max_depth_sigma") > 0:
            raise ValueError(f"max_depth_sigma {self._value('max_depth_sigma')}: give the largest sigma of a point's depth as a part of the depth, 0.1 or .inf")
        names = self._value("point_reasons").replace(",", " ").split()
        for name in names:
            if name not in egosgm.REASONS:
                raise ValueError(f"point_reasons {name}: give some of {', '.join(egosgm.REASONS)}, or none for all")
        self._point_reasons = [egosgm.REASONS.index(name) for name in names]
        if self._value("publish_tf") and self._value("motion_frame"):
            raise ValueError("publish_tf and motion_frame: a motion that comes from tf is not published there again: unset one of them")
        egosgm.Pipeline(egosgm.Calibration(100, 100, 32, 32, 0.1), 64, 64, device=self._value("device"), **self._options())
