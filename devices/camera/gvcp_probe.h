#pragma once

#include <string>

#include "pose/base/time.h"

namespace tbm {

// Whether a GigE Vision device answers at `address` (IPv4) within `timeout`: one discovery request
// to its control port, which changes nothing in the device. Opening a camera that is not there
// costs three seconds inside the library; asking first costs `timeout`.
bool AnswersDiscovery(const std::string& address, Duration timeout);

// The address of this computer's interface that leads to `address`; empty when there is no route.
std::string InterfaceTowards(const std::string& address);

// How much of a receive buffer the system grants a socket that asks for `wanted_bytes`: it silently
// stops at net.core.rmem_max. -1 when there is no socket to be had.
int GrantedSocketBuffer(int wanted_bytes);

}  // namespace tbm
