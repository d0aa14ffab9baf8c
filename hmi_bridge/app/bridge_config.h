#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "hmi_bridge/core/calibration.h"
#include "hmi_bridge/server/server_options.h"
#include "pose/base/result.h"
#include "pose/rig/dds_network.h"
#include "pose/rig/rig_file.h"

namespace tbm::hmi {

// hmi_bridge.yaml.
struct BridgeConfig {
  std::string machine_file;
  std::string state_folder;  // accounts, sessions, audit log
  std::vector<ListenAddress> listen = {{"127.0.0.1", 8080}};
  std::vector<std::string> names;  // by which browsers may call it, besides its addresses
  bool tls_self_signed = false;
  std::string tls_certificate_file;  // empty: no TLS, or one of its own
  std::string tls_key_file;
  std::string web_folder;      // empty: beside the program
  std::string journal_folder;  // of the guidance; empty: no reports out of it
  std::vector<Calibration> calibrations;
  DdsNetwork dds;

  bool has_tls() const { return tls_self_signed || !tls_certificate_file.empty(); }
};

// All faults are collected; each names file, line, key, and what would be right. `file` is for
// messages and for paths, which are relative to it.
Result<BridgeConfig, RigFileFaults> ParseBridgeConfig(std::string_view yaml,
                                                      const std::string& file);
Result<BridgeConfig, RigFileFaults> LoadBridgeConfig(const std::string& path);

}  // namespace tbm::hmi
