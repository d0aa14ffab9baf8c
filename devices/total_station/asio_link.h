#pragma once

#include <memory>
#include <string>

#include "devices/bus/byte_link.h"
#include "pose/base/time.h"

namespace tbm {

// Byte links by Boost.Asio, one thread each and none of their own: every wait runs the operation
// until it is done or its time is over. The library stays invisible to whoever includes this.

// A TCP connection, with TCP_NODELAY (a request is one small write) and keep-alive (a radio that is
// gone says nothing). `address` is IPv4 or IPv6, not a name. Open takes up to `connect_timeout`.
std::unique_ptr<ByteLink> MakeTcpLink(std::string address, int port, Duration connect_timeout);

// A serial port: raw, eight bits, no flow control, locked against a second process.
std::unique_ptr<ByteLink> MakeAsioSerialLink(SerialSettings settings);

}  // namespace tbm
