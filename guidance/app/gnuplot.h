#pragma once

#include <optional>
#include <string>

namespace tbm {

// Draws a picture by the program gnuplot: `script` is its input, without terminal and output, which
// are set for a PNG of the given size at `path`. The file appears only whole. Empty when done, else
// why there is no picture.
std::optional<std::string> DrawPicture(const std::string& script,
                                       int width_px,
                                       int height_px,
                                       const std::string& path,
                                       bool may_replace);

}  // namespace tbm
