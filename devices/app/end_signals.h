#pragma once

namespace tbm {

// SIGINT and SIGTERM wait for WaitForEnd from here on; call it before any thread is made.
void HoldSignals();

// Returns when a signal has come or `run_for_s` (if not 0) is over.
void WaitForEnd(double run_for_s);

// Makes it return, as a signal would.
void EndTheWait();

}  // namespace tbm
