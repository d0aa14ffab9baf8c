#pragma once

#include <string>
#include <vector>

namespace tbm::dds {

// The IPv4 addresses that the wanted interfaces (addresses or names) have now, sorted. Interfaces
// that are down or have no address are left out.
std::vector<std::string> AddressesOf(const std::vector<std::string>& wanted);

// Four decimal numbers with dots.
bool IsIpv4(const std::string& text);

}  // namespace tbm::dds
