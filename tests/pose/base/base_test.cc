#include <set>
#include <string>

#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "pose/base/fixed_vector.h"
#include "pose/base/pose_reason.h"
#include "pose/base/result.h"
#include "pose/base/time.h"

namespace tbm {
namespace {

enum class Fault { kSmall, kLarge };

TEST(Result, HoldsTheValueOrTheReason) {
  const Result<int, Fault> value(7);
  const Result<int, Fault> failure = Failure{Fault::kLarge};
  ASSERT_TRUE(value);
  EXPECT_EQ(*value, 7);
  ASSERT_FALSE(failure);
  EXPECT_EQ(failure.error(), Fault::kLarge);
}

TEST(ResultDeathTest, AskingForTheOtherOneEndsTheProcess) {
  const Result<int, Fault> failure = Failure{Fault::kSmall};
  EXPECT_DEATH((void)failure.value(), "broken invariant: has_value\\(\\)");
}

TEST(FixedVector, KeepsOrderThroughErase) {
  FixedVector<int, 4> numbers;
  for (const int n : {1, 2, 3, 4}) numbers.push_back(n);
  EXPECT_TRUE(numbers.full());
  numbers.erase(1);
  ASSERT_EQ(numbers.size(), 3u);
  EXPECT_EQ(numbers[0], 1);
  EXPECT_EQ(numbers[1], 3);
  EXPECT_EQ(numbers[2], 4);
}

TEST(FixedVectorDeathTest, OneTooManyEndsTheProcess) {
  FixedVector<int, 1> numbers;
  numbers.push_back(1);
  EXPECT_DEATH(numbers.push_back(2), "broken invariant");
}

TEST(Timestamp, DifferencesAreExactAtThisCentury) {
  const Timestamp a{1'790'000'000'200'049'537};
  const Timestamp b{1'790'000'000'200'049'538};
  EXPECT_EQ((b - a).count(), 1);
  EXPECT_EQ(a + Duration(1), b);
}

TEST(Angle, HalfATurn) { EXPECT_DOUBLE_EQ(DegToRad(180.0), 3.14159265358979323846); }

TEST(PoseReason, EveryReasonHasACodeOfItsOwn) {
  std::set<std::string> codes;
  int reasons = 0;
  for (int number = 0; number <= 28; ++number) {
    const bool is_gap = (number > 6 && number < 10) || (number > 16 && number < 20);
    if (is_gap) continue;
    codes.insert(std::string(ReasonCode(static_cast<PoseReason>(number))));
    ++reasons;
  }
  EXPECT_EQ(static_cast<int>(codes.size()), reasons);
  EXPECT_EQ(ReasonCode(PoseReason::kNone), "");
  EXPECT_EQ(StatusCode(PoseStatus::kDegraded), "degraded");
}

}  // namespace
}  // namespace tbm
