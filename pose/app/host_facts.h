#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pose/base/time.h"

namespace tbm {

struct BoxConfig;

// The network interface through which the camera is reached.
struct CameraLink {
  std::string interface;            // "eth0"
  std::optional<int> speed_mbit_s;  // absent on loopback and without a cable
  int mtu_bytes = 0;
  bool has_carrier = false;
  bool is_loopback = false;
};

// What the computer itself says that matters to the box. Gathered at one moment.
struct HostFacts {
  Timestamp now;
  bool is_clock_synchronised = false;         // the kernel's word: NTP or PTP steers it
  std::int64_t receive_buffer_max_bytes = 0;  // net.core.rmem_max
  // Absent when no interface's subnet holds the camera's address, or the camera is not on a
  // network.
  std::optional<CameraLink> camera_link;
  std::vector<std::string> dds_addresses_missing;  // of the configured ones, not there now
  // Of the recordings' disk. Absent without recording, or when the folder cannot be made.
  std::optional<std::int64_t> recording_free_bytes;
  bool is_recording_writable = false;
};

HostFacts GatherHostFacts(const BoxConfig& config, Timestamp now);

}  // namespace tbm
