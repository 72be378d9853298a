// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "egosgm/pipeline.h"
#include "kernels/shared.h"

namespace egosgm {

/// Throws InvalidArgument for a size that no pipeline can have.
void check_size(int width, int height);

/// Throws InvalidArgument, with `what` before the rest, for a type that is none.
void check_type(const std::string& what, PixelType type);

/// Throws InvalidArgument, with `view` before the rest, for a type that is none, and for rows that overlap.
void check_rows(const std::string& view, const ImageView& image);

/// Throws InvalidArgument, naming the view and the value, for what a pipeline of this size cannot take.
void check_frame(shared::ImageSize size, const ImageView& left, const ImageView& right, const FrameOutputs& outputs);

}  // namespace egosgm
