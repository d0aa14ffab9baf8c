#pragma once

#include <cstddef>
#include <optional>

#include "devices/inclinometer/inclinometer.h"
#include "devices/inclinometer/inclinometer_config.h"

namespace tbm {

struct WireReading {
  Inclination raw;
  std::optional<double> temperature_celsius;
  std::size_t request_characters = 0;  // for the time they take on the line
  std::size_t reply_characters = 0;
};

// Questions and answers with the instruments on one serial line, without any policy about when.
class TiltWire {
 public:
  virtual ~TiltWire() = default;

  // Empty when the port is open now.
  virtual std::optional<InclinometerFailure> Open() = 0;
  virtual void Close() = 0;
  virtual bool IsOpen() const = 0;

  // Throws away what came in and nobody waited for. How many bytes that were.
  virtual std::size_t Discard() = 0;

  // Asks one instrument and waits for its reply, at most its response_timeout.
  virtual Result<WireReading, InclinometerFailure> Ask(const InclinometerConfig& instrument) = 0;
};

}  // namespace tbm
