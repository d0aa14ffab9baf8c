#pragma once

#include <string>

namespace tbm::dds {

// For Command: 35 characters, one for each request and never used again.
std::string NewRequestId();

}  // namespace tbm::dds
