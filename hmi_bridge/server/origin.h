#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hmi_bridge/server/http_message.h"

namespace tbm::hmi {

// "name", "name:8080", "[::1]:8080": the name in small letters without brackets. Empty: it is none.
std::optional<std::string> HostName(std::string_view host);

// A browser that was told a foreign name for our address (DNS rebinding) still says that name.
// Ports may differ: consoles come through tunnels as well.
bool IsOurHost(const Request& request, const std::vector<std::string>& allowed_names);

// The page that asks was served by us: by this very name, port and scheme.
bool IsOwnOrigin(const Request& request);

}  // namespace tbm::hmi
