#include <array>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/core/alarm_command.h"

namespace tbm {
namespace {

using std::chrono::minutes;
using testing::HasSubstr;

constexpr Timestamp kNow{1'700'000'000'000'000'000};
constexpr std::array kRules{
    AlarmRule{"deviation_high", AlarmPriority::kHigh, "off the design", "steer back"},
    AlarmRule{"tilt_late", AlarmPriority::kLow, "an inclinometer is silent", "look at its plug"},
};

class AlarmCommand : public testing::Test {
 protected:
  // The sentence of the refusal; empty when it was carried out.
  std::string Refused(std::string_view verb,
                      std::string_view argument,
                      std::string_view because = "works") {
    const auto order = AlarmOrderOf(board_, verb, argument, because);
    if (!order) return order.error();
    Carry(*order, kNow, &board_);
    done_ = DoneText(*order);
    return "";
  }
  AlarmBoard board_{kRules};
  std::string done_;
};

TEST_F(AlarmCommand, IsCarriedOutAsItWasAsked) {
  EXPECT_EQ(Refused("acknowledge", "tilt_late"), "there is nothing to acknowledge");
  (void)board_.Update(1, 1.0, kNow);
  EXPECT_EQ(Refused("acknowledge", " tilt_late "), "");
  EXPECT_EQ(done_, "acknowledged");
  EXPECT_EQ(board_.alarm(1).state, AlarmState::kAcknowledged);
  EXPECT_EQ(Refused("unshelve", "tilt_late"), "it is not shelved");
  EXPECT_EQ(Refused("shelve", "tilt_late 480"), "");
  EXPECT_EQ(done_, "shelved for 480 minutes; unshelve ends it earlier");
  EXPECT_EQ(board_.alarm(1).shelved_until, kNow + minutes(480));
  EXPECT_EQ(Refused("shelve", "  tilt_late \t 1 "), "");
  EXPECT_EQ(done_, "shelved for 1 minute; unshelve ends it earlier");
  EXPECT_EQ(board_.alarm(1).shelved_until, kNow + minutes(1));
  EXPECT_EQ(Refused("unshelve", "tilt_late", ""), "");
  EXPECT_EQ(done_, "no longer shelved");
  EXPECT_FALSE(board_.alarm(1).shelved_until);
}

TEST_F(AlarmCommand, NonsenseIsRefusedWithWhatWouldBeRight) {
  for (const char* argument : {"", " ", "tilt_late", "60"}) {
    EXPECT_THAT(Refused("shelve", argument), HasSubstr("wanted the alarm's code and for how many"))
        << argument;
  }
  for (const char* argument : {"tilt_late 0",
                               "tilt_late -5",
                               "tilt_late 1.5",
                               "tilt_late 60min",
                               "tilt_late nan",
                               "tilt_late 0x10",
                               "tilt_late 99999999999999999999"}) {
    EXPECT_THAT(Refused("shelve", argument),
                HasSubstr("is no number of minutes; wanted 1 to 480 minutes"));
  }
  for (const char* argument : {"60 tilt_late", "roll_high 60", "tilt_late 60 60", "TILT_LATE 60"}) {
    EXPECT_THAT(Refused("shelve", argument), HasSubstr("no alarm has the code '"));
  }
  EXPECT_EQ(Refused("shelve", "tilt_late 481"), "tilt_late may be shelved for at most 480 minutes");
  EXPECT_EQ(Refused("shelve", "tilt_late 9223372036854775807"),
            "tilt_late may be shelved for at most 480 minutes");
  EXPECT_EQ(Refused("shelve", "deviation_high 31"),
            "deviation_high may be shelved for at most 30 minutes");
  for (const char* because : {"", "  \t"}) {
    EXPECT_THAT(Refused("shelve", "tilt_late 60", because), HasSubstr("say why"));
  }
  EXPECT_THAT(Refused("unshelve", "nothing"), HasSubstr("no alarm has the code 'nothing'"));
  EXPECT_THAT(Refused("dance", "tilt_late"), HasSubstr("known are"));
  EXPECT_FALSE(IsAlarmVerb("dance"));
  for (std::size_t i = 0; i < board_.size(); ++i) EXPECT_FALSE(board_.alarm(i).shelved_until);
  Carry({7, AlarmVerb::kShelve, minutes(1)}, kNow, &board_);  // of another board
}

}  // namespace
}  // namespace tbm
