#pragma once

#include <chrono>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "idl/cpp/alarm.h"
#include "idl/cpp/messages.h"

namespace tbm {

// The two times that an age needs, taken together.
struct WatchNow {
  std::chrono::steady_clock::time_point steady;
  Timestamp utc;
};

// How old a sample is: by this machine's steady clock since it came, or by its own stamp, whichever
// is worse. A network that delivers late, a sender that repeats itself and a clock that was set
// back each betray themselves in one of the two.
double WatchAgeS(std::chrono::steady_clock::time_point received_at,
                 Timestamp sensed_at,
                 const WatchNow& now);

enum class WatchStyle { kHeading, kGood, kDegraded, kBad, kStale, kPlain };

// One line of the screen. A stale row carries its last value in brackets: never in normal dress.
struct WatchRow {
  std::string what;
  std::string value;
  std::string sigma;
  std::string age;
  std::string status;
  WatchStyle style = WatchStyle::kPlain;
};

// What is known of all live topics, as rows for a screen. Knows neither DDS nor clocks nor
// terminals. Not thread-safe.
class WatchBoard {
 public:
  using Instant = std::chrono::steady_clock::time_point;

  void Add(const dds::RelativePose& pose, Instant received_at);
  void Add(const dds::TiltReading& tilt, Instant received_at);
  void Add(const dds::FrameFeatures& features, Instant received_at);
  void Add(const dds::DeviceHealth& health, Instant received_at);
  void Add(const dds::Event& event, Instant received_at);
  void Add(const dds::Alarm& alarm);

  bool is_empty() const;
  std::vector<WatchRow> Rows(const WatchNow& now) const;

 private:
  template <class Message>
  struct Heard {
    Message message;
    Instant received_at;
  };

  void AppendPoses(const WatchNow& now, std::vector<WatchRow>& rows) const;
  void AppendTilts(const WatchNow& now, std::vector<WatchRow>& rows) const;
  void AppendFeatures(const WatchNow& now, std::vector<WatchRow>& rows) const;
  void AppendHealth(const WatchNow& now, std::vector<WatchRow>& rows) const;
  void AppendEvents(const WatchNow& now, std::vector<WatchRow>& rows) const;

  // By key in words, so that the order on the screen is the same each time.
  std::map<std::string, Heard<dds::RelativePose>> poses_;
  std::map<std::string, Heard<dds::TiltReading>> tilts_;
  std::map<std::string, Heard<dds::FrameFeatures>> features_;
  std::map<std::string, Heard<dds::DeviceHealth>> health_;
  std::map<std::string, Heard<dds::Event>> events_;
  std::map<std::string, dds::Alarm> alarms_;
};

// The rows as text for a terminal of the given width, colours included when wanted.
std::string WatchScreen(const std::vector<WatchRow>& rows, int width_chars, bool with_colours);

// One sample as a line for a pipe: "relative_pose machine=.. stamp_ns=.. status=ok ..". One that is
// stale on arrival says status=stale and gives no numbers.
std::string WatchLine(const dds::RelativePose& pose, double age_s);
std::string WatchLine(const dds::TiltReading& tilt, double age_s);
std::string WatchLine(const dds::FrameFeatures& features, double age_s);
std::string WatchLine(const dds::DeviceHealth& health, double age_s);
std::string WatchLine(const dds::Event& event, double age_s);
std::string WatchLine(const dds::Alarm& alarm);

}  // namespace tbm
