#include "idl/cpp/request_id.h"

#include <cstdint>
#include <random>

#include <fmt/format.h>

namespace tbm::dds {

std::string NewRequestId() {
  std::random_device device;
  std::string id;
  for (int part = 0; part < 4; ++part) {
    if (part > 0) id += '-';
    id += fmt::format("{:08x}", static_cast<std::uint32_t>(device()));
  }
  return id;
}

}  // namespace tbm::dds
