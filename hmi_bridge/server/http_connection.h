#pragma once

#include "hmi_bridge/server/http_message.h"
#include "hmi_bridge/server/server_core.h"
#include "hmi_bridge/server/wire_stream.h"

namespace tbm::hmi {

// Serves requests on a connection until it ends or becomes a WebSocket. Lives by itself.
void ServeHttp(ServerShared& shared, WireStream stream, const Peer& peer);

}  // namespace tbm::hmi
