#pragma once

#include <string>

namespace tbm::test {

// Puts this process into a network namespace of its own that has nothing but a loopback interface,
// so that camera simulators of tests that run at the same time never meet on UDP port 3956. Call it
// before any thread is made. Returns why it cannot be had; then the computer's own loopback is
// used.
std::string EnterOwnNetwork();

}  // namespace tbm::test
