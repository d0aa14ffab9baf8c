#pragma once

#include <string>
#include <string_view>

namespace tbm {

// What `sha256sum` prints for a file of these bytes: 64 hexadecimal digits.
std::string Sha256(std::string_view bytes);

}  // namespace tbm
