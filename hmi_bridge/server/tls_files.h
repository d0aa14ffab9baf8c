#pragma once

#include <optional>
#include <string>
#include <vector>

#include "hmi_bridge/server/server_options.h"
#include "pose/base/clock.h"
#include "pose/base/result.h"

namespace tbm::hmi {

struct SelfSigned {
  TlsFiles files;
  std::string sha256;  // "AB:CD:..": what a browser shows, to be compared once
};

// Makes `certificate.pem` and `key.pem` in the state folder, for these names and addresses: EC
// P-256, 825 days. The error is a sentence.
Result<SelfSigned, std::string> MakeSelfSigned(const std::string& state_folder,
                                               const std::vector<std::string>& names,
                                               const Clock& clock);

// Whether both can be read and belong together; empty: they do.
std::optional<std::string> WhyNotTls(const TlsFiles& files);

}  // namespace tbm::hmi
