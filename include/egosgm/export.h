// SPDX-License-Identifier: Apache-2.0
#pragma once

/// Marks what the shared libraries show; all else is hidden. A class that is marked shows all its members.
#define EGOSGM_EXPORT __attribute__((visibility("default")))
