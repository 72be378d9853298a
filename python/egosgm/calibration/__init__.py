# SPDX-License-Identifier: Apache-2.0
"""Calibrations: read from files, found by boards, and used to rectify."""
