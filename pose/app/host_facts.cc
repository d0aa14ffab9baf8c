#include "pose/app/host_facts.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <system_error>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/statvfs.h>
#include <sys/timex.h>
#include <unistd.h>

#include "idl/cpp/network_addresses.h"
#include "pose/app/box_config.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;

std::optional<std::int64_t> NumberIn(const std::string& path) {
  std::ifstream file(path);
  std::int64_t number = 0;
  if (!(file >> number)) return std::nullopt;
  return number;
}

std::uint32_t Ipv4Of(const sockaddr* address) {
  return ntohl(reinterpret_cast<const sockaddr_in*>(address)->sin_addr.s_addr);
}

std::optional<CameraLink> LinkTo(const std::string& camera_address) {
  in_addr wanted{};
  if (inet_pton(AF_INET, camera_address.c_str(), &wanted) != 1) return std::nullopt;
  const std::uint32_t camera = ntohl(wanted.s_addr);
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return std::nullopt;
  std::optional<CameraLink> link;
  std::uint32_t narrowest_mask = 0;
  for (const ifaddrs* one = all; one != nullptr; one = one->ifa_next) {
    if (one->ifa_addr == nullptr || one->ifa_netmask == nullptr ||
        one->ifa_addr->sa_family != AF_INET) {
      continue;
    }
    const std::uint32_t mask = Ipv4Of(one->ifa_netmask);
    if ((Ipv4Of(one->ifa_addr) & mask) != (camera & mask) || mask < narrowest_mask) continue;
    narrowest_mask = mask;
    CameraLink found;
    found.interface = one->ifa_name;
    found.is_loopback = (one->ifa_flags & IFF_LOOPBACK) != 0;
    found.has_carrier = (one->ifa_flags & IFF_RUNNING) != 0;
    link = found;
  }
  freeifaddrs(all);
  if (!link) return std::nullopt;
  const std::string folder = "/sys/class/net/" + link->interface;
  const auto speed = NumberIn(folder + "/speed");
  if (speed && *speed > 0) link->speed_mbit_s = static_cast<int>(*speed);
  link->mtu_bytes = static_cast<int>(NumberIn(folder + "/mtu").value_or(0));
  return link;
}

bool IsWritable(const fs::path& folder) {
  const fs::path probe = folder / fmt::format(".self_test_{}", getpid());
  std::ofstream file(probe);
  file << "x";
  file.close();
  const bool is_written = file.good();
  std::error_code ignored;
  fs::remove(probe, ignored);
  return is_written;
}

}  // namespace

HostFacts GatherHostFacts(const BoxConfig& config, Timestamp now) {
  HostFacts facts;
  facts.now = now;
  timex kernel{};
  const int state = adjtimex(&kernel);
  facts.is_clock_synchronised = state >= 0 && state != TIME_ERROR && !(kernel.status & STA_UNSYNC);
  facts.receive_buffer_max_bytes = NumberIn("/proc/sys/net/core/rmem_max").value_or(0);
  if (config.camera.driver == CameraDriver::kGige) {
    facts.camera_link = LinkTo(config.camera.address);
  }
  for (const std::string& interface : config.dds.interfaces) {
    if (dds::AddressesOf({interface}).empty()) facts.dds_addresses_missing.push_back(interface);
  }
  if (!config.recording.folder.empty()) {
    std::error_code error;
    fs::create_directories(config.recording.folder, error);
    struct statvfs disk {};
    if (statvfs(config.recording.folder.c_str(), &disk) == 0) {
      facts.recording_free_bytes =
          static_cast<std::int64_t>(disk.f_bavail) * static_cast<std::int64_t>(disk.f_frsize);
      facts.is_recording_writable = IsWritable(config.recording.folder);
    }
  }
  return facts;
}

}  // namespace tbm
