#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hmi_bridge/core/view_json.h"
#include "idl/cpp/guidance_messages.h"

namespace tbm::hmi {

// Rows of equal width in memory that is taken once; the oldest make room.
class RowRing {
 public:
  RowRing(std::size_t most_rows, std::size_t row_width);

  void Push(const std::vector<float>& row, std::int64_t at_utc_ms, double chainage_m);
  void DropNewest();

  std::size_t size() const { return size_; }
  // 0 is the oldest.
  std::int64_t at_utc_ms(std::size_t index) const { return at_[Slot(index)]; }
  double chainage_m(std::size_t index) const { return chainage_[Slot(index)]; }
  const float* row(std::size_t index) const { return &rows_[Slot(index) * width_]; }

 private:
  std::size_t Slot(std::size_t index) const { return (first_ + index) % at_.size(); }

  std::size_t width_;
  std::vector<std::int64_t> at_;
  std::vector<double> chainage_;  // of the point that one steers by; NaN: not known
  std::vector<float> rows_;
  std::size_t first_ = 0;
  std::size_t size_ = 0;
};

// What the deviations of each point were: one row a second for 24 hours, and one each 50 mm of
// advance for 1000 m. Bounded; forgets with the process.
class History {
 public:
  static constexpr std::size_t kMostSeconds = 24 * 3600;
  static constexpr double kAdvanceStep_m = 0.05;
  static constexpr std::size_t kMostSteps = 20'000;

  // Names in the order in which guidance sends its points.
  History(std::vector<std::string> points, std::string steer_by);

  void Add(const dds::Guidance& guidance);

  // openapi.yaml, `History`; empty for a point that is not the machine's.
  std::optional<Json> Between(std::string_view point,
                              std::int64_t from_utc_ms,
                              std::int64_t to_utc_ms,
                              std::size_t most_rows) const;
  // Back from the newest row over `length_m` of advance.
  std::optional<Json> Back(std::string_view point, double length_m) const;

 private:
  void AddAdvance(double chainage_m, std::int64_t at_utc_ms);
  std::optional<std::size_t> Find(std::string_view point) const;
  Json Columns(const RowRing& ring, std::size_t point, const std::vector<std::size_t>& rows) const;

  std::vector<std::string> points_;
  std::string steer_by_;
  std::vector<float> scratch_;
  RowRing by_time_;
  RowRing by_advance_;
};

}  // namespace tbm::hmi
