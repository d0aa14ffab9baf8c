#include "guidance/rail/track_geometry.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include <gtest/gtest.h>

#include "guidance/rail/band_pass.h"
#include "tests/support/random.h"

namespace tbm {
namespace {

using Form = std::function<double(double)>;
const Form kNothing = [](double) { return 0.0; };

Form Wave(double amplitude_m, double wavelength_m) {
  return
      [=](double m) { return amplitude_m * std::sin(2.0 * std::numbers::pi * m / wavelength_m); };
}

struct Track {
  double length_m = 700.0;
  double radius_m = 0.0;  // 0: straight; turning left
  double heading_rad = 0.3;
  Form up_m = kNothing;
  Form left_m = kNothing;
  Form roll_rad = kNothing;  // + where the right side goes down
  double nose_up_rad = 0.0;
  double yaw_on_trolley_rad = 0.0;
};

std::vector<RailPoint> Line(const Track& track) {
  std::vector<RailPoint> points;
  for (int i = 0; i * 0.02 <= track.length_m; ++i) {
    const double m = i * 0.02;
    const double turned_rad = track.radius_m > 0.0 ? m / track.radius_m : 0.0;
    const double heading_rad = track.heading_rad + turned_rad;
    Eigen::Vector2d plan(m * std::cos(heading_rad), m * std::sin(heading_rad));
    if (track.radius_m > 0.0) {
      plan = track.radius_m * Eigen::Vector2d(std::sin(heading_rad), -std::cos(heading_rad));
    }
    plan += track.left_m(m) * Eigen::Vector2d(-std::sin(heading_rad), std::cos(heading_rad));
    RailPoint point;
    point.at = {std::int64_t{i} * 20'000'000};
    point.distance_m = m;
    point.position_world_m << plan.x(), plan.y(), track.up_m(m);
    point.world_from_imu = Eigen::AngleAxisd(heading_rad, Eigen::Vector3d::UnitZ()) *
                           Eigen::AngleAxisd(-track.nose_up_rad, Eigen::Vector3d::UnitY()) *
                           Eigen::AngleAxisd(track.roll_rad(m), Eigen::Vector3d::UnitX()) *
                           Eigen::AngleAxisd(track.yaw_on_trolley_rad, Eigen::Vector3d::UnitZ());
    points.push_back(point);
  }
  return points;
}

using Pick = std::optional<double> TrackPlace::*;

std::vector<TrackPlace> Measured(const Track& track, const TrackGeometryOptions& options = {}) {
  return MeasureTrack(Line(track), options);
}

// Amplitude of a wavelength in a column, by least squares.
double Amplitude(const std::vector<TrackPlace>& places, Pick pick, double wavelength_m) {
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  for (const TrackPlace& place : places) {
    if (!(place.*pick)) continue;
    const double phase = 2.0 * std::numbers::pi * place.distance_m / wavelength_m;
    const Eigen::Vector2d row(std::sin(phase), std::cos(phase));
    normal += row * row.transpose();
    right += row * *(place.*pick);
  }
  EXPECT_GT(normal.trace(), 100.0);
  return Eigen::Vector2d(normal.inverse() * right).norm();
}

TEST(BandPass, GainIsStatedAtTheEndsAndOutside) {
  const BandPass d1(3.0, 25.0, 0.25);
  const BandPass d2(25.0, 70.0, 0.25);
  EXPECT_NEAR(d1.Gain(3.0), std::numbers::sqrt2 / 2.0, 1e-3);
  EXPECT_NEAR(d1.Gain(25.0), std::numbers::sqrt2 / 2.0, 1e-3);
  EXPECT_NEAR(d2.Gain(25.0), std::numbers::sqrt2 / 2.0, 1e-3);
  EXPECT_NEAR(d2.Gain(70.0), std::numbers::sqrt2 / 2.0, 1e-3);
  for (const double wavelength_m : {5.0, 8.0, 12.0, 16.0}) {
    EXPECT_NEAR(d1.Gain(wavelength_m), 1.0, 0.015) << wavelength_m;
  }
  for (const double wavelength_m : {38.0, 42.0, 46.0}) {
    EXPECT_NEAR(d2.Gain(wavelength_m), 1.0, 0.02) << wavelength_m;
  }
  for (const double wavelength_m : {1.5, 1.0, 50.0, 100.0}) EXPECT_LT(d1.Gain(wavelength_m), 0.01);
  for (const double wavelength_m : {5.0, 12.5, 140.0}) EXPECT_LT(d2.Gain(wavelength_m), 0.01);
}

TEST(BandPass, FilteredSinesHaveThatGainAndNoPhase) {
  const BandPass d1(3.0, 25.0, 0.25);
  for (const double wavelength_m : {2.0, 3.0, 4.0, 10.0, 25.0, 33.0, 60.0}) {
    std::vector<double> samples;
    for (int i = 0; i < 2000; ++i) samples.push_back(Wave(1.0, wavelength_m)(0.25 * i));
    const auto filtered = d1.Filtered(samples);
    double worst = 0.0;
    for (std::size_t i = 0; i < filtered.size(); ++i) {
      if (!filtered[i]) continue;
      worst = std::max(worst, std::abs(*filtered[i] - d1.Gain(wavelength_m) * samples[i]));
    }
    EXPECT_LT(worst, 0.015) << wavelength_m << ": gain, phase and what the ends add";
  }
}

TEST(BandPass, LeavesTheEndsEmpty) {
  const BandPass d1(3.0, 25.0, 0.25);
  EXPECT_DOUBLE_EQ(d1.room_m(), 50.0);
  const auto filtered = d1.Filtered(std::vector<double>(1001, 1.0));
  for (std::size_t i = 0; i < filtered.size(); ++i) {
    EXPECT_EQ(filtered[i].has_value(), i >= 200 && i <= 800) << i;
  }
  for (const auto& value : d1.Filtered(std::vector<double>(400, 1.0))) EXPECT_FALSE(value);
  // What lies beyond either end is not felt: 5 mm of roughness, with the line before and behind it.
  test::Random random("ends");
  std::vector<double> whole;
  for (int i = 0; i < 3000; ++i)
    whole.push_back(random.Normal(0.005) + Wave(0.005, 20.0)(0.25 * i));
  const auto of_whole = d1.Filtered(whole);
  const auto of_part = d1.Filtered(std::span(whole).subspan(1000, 1000));
  for (std::size_t i = 200; i < 800; ++i) {
    EXPECT_NEAR(*of_part[i], *of_whole[1000 + i], 6e-5) << i;
  }
}

class InBothDirections : public ::testing::TestWithParam<bool> {
 protected:
  Track WithWave(double amplitude_m, double wavelength_m) const {
    Track track;
    (GetParam() ? track.up_m : track.left_m) = Wave(amplitude_m, wavelength_m);
    return track;
  }
  Pick D1() const { return GetParam() ? &TrackPlace::level_d1_m : &TrackPlace::alignment_d1_m; }
  Pick D2() const { return GetParam() ? &TrackPlace::level_d2_m : &TrackPlace::alignment_d2_m; }
  Pick OtherD1() const {
    return GetParam() ? &TrackPlace::alignment_d1_m : &TrackPlace::level_d1_m;
  }
};

TEST_P(InBothDirections, WavesInsideABandPassAndOutsideDoNot) {
  struct Case {
    double wavelength_m, d1, d2, tolerance;
  };
  for (const Case& c : {Case{1.2, 0.0, 0.0, 0.02},
                        Case{6.0, 1.0, 0.0, 0.02},
                        Case{12.0, 1.0, 0.0, 0.02},
                        Case{42.0, 0.0, 1.0, 0.05},
                        Case{25.0, 0.707, 0.707, 0.02},
                        Case{180.0, 0.0, 0.0, 0.02}}) {
    const auto places = Measured(WithWave(0.004, c.wavelength_m));
    EXPECT_NEAR(Amplitude(places, D1(), c.wavelength_m), 0.004 * c.d1, 0.004 * c.tolerance)
        << c.wavelength_m;
    EXPECT_NEAR(Amplitude(places, D2(), c.wavelength_m), 0.004 * c.d2, 0.004 * c.tolerance)
        << c.wavelength_m;
    EXPECT_LT(Amplitude(places, OtherD1(), c.wavelength_m), 4e-6);
    EXPECT_NEAR(Amplitude(places, D1(), c.wavelength_m),
                0.004 * TrackGain(kBandD1, 0.25, c.wavelength_m),
                4e-5)
        << c.wavelength_m;
  }
}
INSTANTIATE_TEST_SUITE_P(UpAndLeft, InBothDirections, ::testing::Bool());

TEST(TrackGeometry, SignsAreUpAndLeft) {
  const auto bump = [](double m) {
    return 0.005 * std::exp(-0.5 * std::pow((m - 350.0) / 2.0, 2));
  };
  const auto places = Measured({.up_m = bump, .left_m = bump});
  ASSERT_NEAR(places[1399].distance_m, 350.0, 1e-9);
  EXPECT_GT(*places[1399].level_d1_m, 0.002);
  EXPECT_GT(*places[1399].alignment_d1_m, 0.002);
}

// Curves and hills are no faults of the track.
TEST(TrackGeometry, EvenCurveAndGradientGiveNothing) {
  Track track{.radius_m = 300.0, .heading_rad = 1.5};  // through half a turn
  track.up_m = [](double m) { return 100.0 + 0.02 * m - m * m / 10000.0; };
  for (const TrackPlace& place : Measured(track)) {
    for (const auto& value :
         {place.level_d1_m, place.level_d2_m, place.alignment_d1_m, place.alignment_d2_m}) {
      EXPECT_LT(std::abs(value.value_or(0.0)), 2e-5) << place.distance_m;
    }
  }
  track.left_m = Wave(0.004, 10.0);
  EXPECT_NEAR(Amplitude(Measured(track), &TrackPlace::alignment_d1_m, 10.0), 0.004, 8e-5);
}

TEST(TrackGeometry, CrossLevelIsThatOfTheLeftSide) {
  // Right side down by 10 mrad, climbing: whatever way the unit sits on its trolley.
  for (const double yaw_rad : {0.0, 0.4, std::numbers::pi}) {
    const Track track{.length_m = 20.0,
                      .up_m = [](double m) { return 0.03 * m; },
                      .roll_rad = [](double) { return 0.010; },
                      .nose_up_rad = 0.03,
                      .yaw_on_trolley_rad = yaw_rad};
    const auto places = Measured(track, {.bases_m = {3.0}, .gauge_m = 1.435});
    ASSERT_TRUE(places[20].cross_level_m);
    EXPECT_NEAR(*places[20].cross_level_m, 1.435 * std::sin(0.010), 1e-5) << yaw_rad;
  }
}

TEST(TrackGeometry, FindsThePlantedTwist) {
  // 4.5 mm of cross level over 3 m, in the middle of 30 m: 1.5 mm/m.
  const auto roll_rad = [](double m) {
    return std::asin(0.0045 * std::clamp((m - 13.5) / 3.0, 0.0, 1.0) / 1.435);
  };
  const auto places =
      Measured({.length_m = 30.0, .roll_rad = roll_rad}, {.bases_m = {3.0, 6.0, 2.3, 50.0}});
  double largest_3 = 0.0;
  for (const TrackPlace& place : places) {
    ASSERT_EQ(place.twist.size(), 4u);
    const bool has_room = place.distance_m > 1.5 + 0.2 && place.distance_m < 30.0 - 1.5 - 0.2;
    EXPECT_EQ(place.twist[0].has_value(), has_room) << place.distance_m;
    EXPECT_FALSE(place.twist[3]) << "no room for 50 m";
    if (place.twist[0]) largest_3 = std::max(largest_3, *place.twist[0]);
    if (std::abs(place.distance_m - 15.0) > 1e-6) continue;
    EXPECT_NEAR(*place.twist[0], 0.0015, 4e-5) << "the mean over a step blunts corners";
    EXPECT_NEAR(*place.twist[1], 0.00075, 2e-6);
    EXPECT_NEAR(*place.twist[2], 0.0015, 2e-6) << "a base that is no multiple of the step";
  }
  EXPECT_LT(largest_3, 0.0015 + 1e-6);
  EXPECT_FALSE(places.front().level_d1_m) << "30 m are too short for the filter";
}

TEST(TrackGeometry, HolesBreakTheLine) {
  Track track{.length_m = 400.0, .up_m = Wave(0.004, 10.0)};
  std::vector<RailPoint> points = Line(track);
  for (RailPoint& point : points) {
    if (point.distance_m > 199.0 && point.distance_m < 201.0) point.status = RailStatus::kGap;
  }
  const auto places = MeasureTrack(points, {.bases_m = {3.0}});
  for (std::size_t i = 0; i < places.size(); ++i) {
    const TrackPlace& place = places[i];
    if (i > 0) {
      EXPECT_NEAR(place.distance_m - places[i - 1].distance_m, 0.25, 1e-9);
    }
    const double from_break_m = std::abs(place.distance_m - 200.0);
    EXPECT_EQ(place.cross_level_m.has_value(), from_break_m > 1.0) << place.distance_m;
    if (from_break_m < 51.0) {
      EXPECT_FALSE(place.level_d1_m) << place.distance_m;
    }
    if (from_break_m < 2.5) {
      EXPECT_FALSE(place.twist[0]) << place.distance_m;
    }
  }
  EXPECT_TRUE(places[400].level_d1_m) << "in the middle of a piece";
}

}  // namespace
}  // namespace tbm
