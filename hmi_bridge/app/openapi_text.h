#pragma once

#include <string_view>

namespace tbm::hmi {

// hmi_bridge/openapi.yaml as it was when the program was built.
std::string_view OpenApiText();

}  // namespace tbm::hmi
