#pragma once

#include "hmi_bridge/server/http_parse.h"
#include "hmi_bridge/server/router.h"
#include "hmi_bridge/server/server_core.h"
#include "hmi_bridge/server/wire_stream.h"

namespace tbm::hmi {

// Makes the connection the WebSocket that the router has allowed. Lives by itself from then on.
void OpenWebSocket(ServerShared& shared,
                   WireStream stream,
                   const BeastRequest& request,
                   const Upgrade& upgrade);

}  // namespace tbm::hmi
