#pragma once

#include <map>
#include <string>
#include <vector>

#include "guidance/app/watch_row.h"
#include "idl/cpp/rail_messages.h"

namespace tbm {

// The trolley, its last line, what has sunk, and the calibrations in use, as rows. Knows neither
// DDS nor clocks nor terminals.
class RailBoard {
 public:
  void Add(const dds::TrolleyState& state, WatchInstant received_at);
  void Add(const dds::RailLinePiece& piece, WatchInstant received_at);
  void Add(const dds::SettlementPiece& piece, WatchInstant received_at);
  void Add(const dds::CalibrationStatus& status, WatchInstant received_at);

  bool is_empty() const;
  void Append(const WatchNow& now, std::vector<WatchRow>& rows) const;

 private:
  // What has come of a line: one that is not whole is never shown as if it were.
  template <class Piece>
  struct Gathered {
    Piece newest;
    WatchInstant received_at;
    std::map<int, Piece> pieces;
  };

  void AppendTrolleys(const WatchNow& now, std::vector<WatchRow>& rows) const;
  void AppendLines(const WatchNow& now, std::vector<WatchRow>& rows) const;
  void AppendSettlements(const WatchNow& now, std::vector<WatchRow>& rows) const;
  void AppendCalibrations(const WatchNow& now, std::vector<WatchRow>& rows) const;

  std::map<std::string, WatchHeard<dds::TrolleyState>> trolleys_;
  std::map<std::string, Gathered<dds::RailLinePiece>> lines_;
  std::map<std::string, Gathered<dds::SettlementPiece>> settlements_;
  std::map<std::string, WatchHeard<dds::CalibrationStatus>> calibrations_;
};

}  // namespace tbm
