#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/axis/design_axis.h"
#include "tests/guidance/axis/made_axis.h"

namespace tbm {
namespace {

using test::MadeAxis;
using test::Part;

MadeAxis Drive() { return test::MakeDrive({{4000.0, 9000.0}, 0.4}, 1000.0); }

// What is said when one thing in a good description is spoiled.
AxisRemarks After(const std::function<void(AxisDescription&)>& spoil) {
  AxisDescription description = Drive().description;
  spoil(description);
  const AxisRemarks remarks = Inspect(description);
  EXPECT_EQ(DesignAxis::Build(description).has_value(), !IsRefused(remarks));
  return remarks;
}

const AxisRemark* Find(const AxisRemarks& remarks, AxisRemarkCode code) {
  const auto found = std::find_if(remarks.begin(), remarks.end(), [code](const AxisRemark& remark) {
    return remark.code == code;
  });
  return found == remarks.end() ? nullptr : &*found;
}

template <class Shape>
Shape& ShapeOf(AxisDescription& description, std::size_t element) {
  return std::get<Shape>(description.plan[element].shape);
}

// Elements of Drive(): 0 line, 1 clothoid, 2 curve right, 3 clothoid, 4 line, 5 Bloss, 6 curve
// left, 7 Bloss, 8 line; their lines are 10, 11, ..
constexpr std::size_t kClothoid = 1;
constexpr std::size_t kCurve = 2;
constexpr std::size_t kMiddleLine = 4;

TEST(Inspect, FindsNothingInAGoodDescription) { EXPECT_TRUE(Inspect(Drive().description).empty()); }

TEST(Inspect, TellsGapsByTheirSizeAndPlace) {
  const auto with_gap = [](double gap_m) {
    return After([gap_m](AxisDescription& d) {
      ShapeOf<LineElement>(d, kMiddleLine).start.x() += gap_m;
      d.plan[kMiddleLine].stated = {};
    });
  };
  EXPECT_EQ(Find(with_gap(0.0002), AxisRemarkCode::kGap), nullptr) << "rounding";
  const AxisRemarks odd = with_gap(0.002);
  ASSERT_NE(Find(odd, AxisRemarkCode::kGap), nullptr);
  EXPECT_EQ(Find(odd, AxisRemarkCode::kGap)->severity, Severity::kOdd);
  EXPECT_NEAR(Find(odd, AxisRemarkCode::kGap)->size, 0.002, 1e-9);
  const AxisRemarks refused = with_gap(0.02);
  ASSERT_NE(Find(refused, AxisRemarkCode::kGap), nullptr);
  EXPECT_EQ(Find(refused, AxisRemarkCode::kGap)->severity, Severity::kRefused);
  EXPECT_EQ(Find(refused, AxisRemarkCode::kGap)->line, 14);
  EXPECT_NEAR(Find(refused, AxisRemarkCode::kGap)->at.m, 1340.0, 1e-6);
}

TEST(Inspect, AnAxisWithASmallGapIsContinuous) {
  AxisDescription description = Drive().description;
  ShapeOf<LineElement>(description, kMiddleLine).start.x() += 0.002;
  description.plan[kMiddleLine].stated = {};
  const auto axis = DesignAxis::Build(description);
  ASSERT_TRUE(axis.has_value());
  for (std::size_t i = 1; i < axis->plan().element_count(); ++i) {
    const double joint_m = axis->plan().element_start(i).m;
    const auto before = axis->At({joint_m - 1e-9});
    const auto behind = axis->At({joint_m + 1e-9});
    EXPECT_LT((before->p_plan_in_site - behind->p_plan_in_site).norm(), 4e-9);
  }
}

TEST(Inspect, TellsKinks) {
  // The middle line is turned about its start by 0.2 mrad: 10 mm at its end, where all that follows
  // is moved along.
  const AxisRemarks remarks = After([](AxisDescription& d) {
    auto& line = ShapeOf<LineElement>(d, kMiddleLine);
    const Eigen::Vector2d along = line.end - line.start;
    const Eigen::Vector2d moved = 2e-4 * Eigen::Vector2d(-along.y(), along.x());
    line.end += moved;
    for (std::size_t i = kMiddleLine + 1; i < d.plan.size(); ++i) {
      std::visit(
          [&](auto& shape) {
            shape.start += moved;
            shape.end += moved;
          },
          d.plan[i].shape);
      if (auto* curve = std::get_if<CurveElement>(&d.plan[i].shape)) *curve->centre += moved;
    }
  });
  ASSERT_EQ(remarks.size(), 2u);
  for (const AxisRemark& remark : remarks) {
    EXPECT_EQ(remark.code, AxisRemarkCode::kKink);
    EXPECT_EQ(remark.severity, Severity::kOdd);
    EXPECT_NEAR(remark.size, 2e-4, 1e-8);
  }
  EXPECT_EQ(remarks[0].line, 14);
  EXPECT_EQ(remarks[1].line, 15);
}

TEST(Inspect, RecognisesMirroredElements) {
  const AxisRemarks curve =
      After([](AxisDescription& d) { ShapeOf<CurveElement>(d, kCurve).turning = Turning::kLeft; });
  ASSERT_NE(Find(curve, AxisRemarkCode::kTurningMirrored), nullptr) << "rot alone";
  EXPECT_EQ(Find(curve, AxisRemarkCode::kTurningMirrored)->line, 12);
  const AxisRemarks bulge = After([](AxisDescription& d) {
    auto& element = ShapeOf<CurveElement>(d, kCurve);
    element.turning = Turning::kLeft;
    const Eigen::Vector2d middle = 0.5 * (element.start + element.end);
    element.centre = 2.0 * middle - *element.centre;
  });
  ASSERT_NE(Find(bulge, AxisRemarkCode::kTurningMirrored), nullptr) << "rot and centre";
  const AxisRemarks spiral = After(
      [](AxisDescription& d) { ShapeOf<SpiralElement>(d, kClothoid).turning = Turning::kLeft; });
  ASSERT_NE(Find(spiral, AxisRemarkCode::kTurningMirrored), nullptr);
  EXPECT_EQ(Find(spiral, AxisRemarkCode::kTurningMirrored)->line, 11);
}

// Without neighbours the stated PI, or length, tells.
TEST(Inspect, RecognisesAMirroredElementThatStandsAlone) {
  const AxisDescription drive = Drive().description;
  AxisDescription alone;
  alone.plan = {drive.plan[kClothoid]};
  auto& spiral = ShapeOf<SpiralElement>(alone, 0);
  const MadeAxis made = Drive();
  const auto states = made.States({80.0, 140.0});
  const double first = made.Heading(states[0]);
  const double last = made.Heading(states[1]);
  const Eigen::Vector2d chord = spiral.end - spiral.start;
  const double along =
      (chord.x() * std::sin(last) - chord.y() * std::cos(last)) / std::sin(last - first);
  alone.plan[0].stated.intersection =
      spiral.start + along * Eigen::Vector2d(std::cos(first), std::sin(first));
  alone.plan[0].stated.start_chainage_m.reset();
  EXPECT_TRUE(Inspect(alone).empty());
  spiral.turning = Turning::kLeft;
  EXPECT_NE(Find(Inspect(alone), AxisRemarkCode::kTurningMirrored), nullptr);
  spiral.turning = Turning::kRight;
  std::swap(spiral.curvature_start_per_m, spiral.curvature_end_per_m);
  EXPECT_NE(Find(Inspect(alone), AxisRemarkCode::kRadiiSwapped), nullptr);
  alone.plan = {drive.plan[kCurve]};
  EXPECT_TRUE(Inspect(alone).size() == 1u) << "only the chainage of its start";
  ShapeOf<CurveElement>(alone, 0).turning = Turning::kLeft;
  EXPECT_NE(Find(Inspect(alone), AxisRemarkCode::kTurningMirrored), nullptr);
}

TEST(Inspect, RecognisesSwappedRadiiAndEnds) {
  const AxisRemarks radii = After([](AxisDescription& d) {
    auto& spiral = ShapeOf<SpiralElement>(d, kClothoid);
    std::swap(spiral.curvature_start_per_m, spiral.curvature_end_per_m);
  });
  ASSERT_NE(Find(radii, AxisRemarkCode::kRadiiSwapped), nullptr);
  const AxisRemarks ends = After([](AxisDescription& d) {
    auto& line = ShapeOf<LineElement>(d, kMiddleLine);
    std::swap(line.start, line.end);
  });
  ASSERT_NE(Find(ends, AxisRemarkCode::kEndsSwapped), nullptr);
  EXPECT_EQ(Find(ends, AxisRemarkCode::kEndsSwapped)->line, 14);
}

TEST(Inspect, TellsASpiralThatLeadsElsewhere) {
  const AxisRemarks length =
      After([](AxisDescription& d) { ShapeOf<SpiralElement>(d, kClothoid).length_m += 0.1; });
  ASSERT_NE(Find(length, AxisRemarkCode::kSpiralMisses), nullptr);
  EXPECT_NEAR(Find(length, AxisRemarkCode::kSpiralMisses)->size, 0.1, 2e-3);
  // A law that does not belong to the stated points: the chord hardly tells, the kinks do.
  const AxisRemarks law = After(
      [](AxisDescription& d) { ShapeOf<SpiralElement>(d, kClothoid).law = SpiralLaw::kBloss; });
  EXPECT_FALSE(law.empty());
}

TEST(Inspect, RefusesFormulasOutsideTheirRange) {
  const AxisRemarks between = After([](AxisDescription& d) {
    auto& spiral = ShapeOf<SpiralElement>(d, kClothoid);
    spiral.law = SpiralLaw::kJapaneseCubic;
    spiral.curvature_start_per_m = 1e-4;
  });
  EXPECT_NE(Find(between, AxisRemarkCode::kSpiralBetweenCurves), nullptr);
  const AxisRemarks steep = After([](AxisDescription& d) {
    auto& spiral = ShapeOf<SpiralElement>(d, kClothoid);
    spiral.law = SpiralLaw::kCubicParabola;
    spiral.curvature_end_per_m = 1.0 / 40.0;
  });
  EXPECT_NE(Find(steep, AxisRemarkCode::kSpiralTurnsTooFar), nullptr);
  const AxisRemarks round = After(
      [](AxisDescription& d) { ShapeOf<SpiralElement>(d, kClothoid).curvature_end_per_m = 0.2; });
  EXPECT_NE(Find(round, AxisRemarkCode::kTurnsTooFar), nullptr);
  const AxisRemarks equal = After(
      [](AxisDescription& d) { ShapeOf<SpiralElement>(d, kClothoid).curvature_end_per_m = 0.0; });
  EXPECT_NE(Find(equal, AxisRemarkCode::kSpiralRadiiEqual), nullptr);
}

TEST(Inspect, TellsCurvesThatDoNotFit) {
  const auto curve = [](const std::function<void(CurveElement&)>& spoil) {
    return After([&](AxisDescription& d) { spoil(ShapeOf<CurveElement>(d, kCurve)); });
  };
  const AxisRemarks radius = curve([](CurveElement& c) { c.radius_m = 301.0; });
  ASSERT_NE(Find(radius, AxisRemarkCode::kValueDisagrees), nullptr);
  EXPECT_EQ(Find(radius, AxisRemarkCode::kValueDisagrees)->quantity, StatedQuantity::kRadius);
  EXPECT_EQ(Find(radius, AxisRemarkCode::kValueDisagrees)->stated, 301.0);
  EXPECT_NEAR(Find(radius, AxisRemarkCode::kValueDisagrees)->computed, 300.0, 1e-6);
  const AxisRemarks centre = curve([](CurveElement& c) { c.centre->x() += 0.1; });
  EXPECT_NE(Find(centre, AxisRemarkCode::kCentreOff), nullptr);
  const AxisRemarks small = curve([](CurveElement& c) {
    c.centre.reset();
    c.radius_m = 20.0;
  });
  EXPECT_NE(Find(small, AxisRemarkCode::kRadiusTooSmall), nullptr);
  const AxisRemarks none = curve([](CurveElement& c) {
    c.centre.reset();
    c.radius_m.reset();
  });
  EXPECT_NE(Find(none, AxisRemarkCode::kRadiusMissing), nullptr);
  const AxisRemarks point = curve([](CurveElement& c) { c.end = c.start; });
  EXPECT_NE(Find(point, AxisRemarkCode::kNoLength), nullptr);
  const AxisRemarks nan = curve([](CurveElement& c) { c.centre->x() = std::nan(""); });
  EXPECT_NE(Find(nan, AxisRemarkCode::kNotFinite), nullptr);
  // Without a centre the radius alone makes the same curve.
  EXPECT_TRUE(curve([](CurveElement& c) { c.centre.reset(); }).empty());
}

TEST(Inspect, ComparesEveryRedundantValue) {
  struct Case {
    StatedQuantity quantity;
    std::size_t element;
    std::function<void(StatedValues&)> state;
  };
  const Case cases[] = {
      {StatedQuantity::kLength, 0, [](StatedValues& s) { s.length_m = 80.01; }},
      {StatedQuantity::kChord, 2, [](StatedValues& s) { s.chord_m = 140.0; }},
      {StatedQuantity::kTurn, 2, [](StatedValues& s) { s.turn_rad = 0.5; }},
      {StatedQuantity::kBearingStart, 0, [](StatedValues& s) { s.bearing_start_rad = 0.4 + M_PI; }},
      {StatedQuantity::kBearingEnd, 2, [](StatedValues& s) { s.bearing_end_rad = 0.1; }},
      {StatedQuantity::kClothoidConstant,
       1,
       [](StatedValues& s) { s.clothoid_constant_m = 100.0; }},
      {StatedQuantity::kTotalX, 1, [](StatedValues& s) { s.total_x_m = 60.0; }},
      {StatedQuantity::kTotalY, 1, [](StatedValues& s) { s.total_y_m = -1.9; }},
      {StatedQuantity::kTangent, 2, [](StatedValues& s) { s.tangent_m = 70.0; }},
      {StatedQuantity::kTangentLong, 1, [](StatedValues& s) { s.tangent_long_m = 41.0; }},
      {StatedQuantity::kTangentShort, 1, [](StatedValues& s) { s.tangent_short_m = 19.0; }},
      {StatedQuantity::kIntersection,
       2,
       [](StatedValues& s) {
         s.intersection = {4100.0, 9100.0};
       }},
  };
  for (const Case& c : cases) {
    SCOPED_TRACE(static_cast<int>(c.quantity));
    const AxisRemarks remarks =
        After([&](AxisDescription& d) { c.state(d.plan[c.element].stated); });
    const AxisRemark* remark = Find(remarks, AxisRemarkCode::kValueDisagrees);
    ASSERT_NE(remark, nullptr);
    EXPECT_EQ(remark->quantity, c.quantity);
    EXPECT_EQ(remark->line, 10 + static_cast<int>(c.element));
  }
  // The same values as they are: nothing is said.
  const AxisRemarks right = After([](AxisDescription& d) {
    StatedValues& curve = d.plan[kCurve].stated;
    curve.chord_m = 2.0 * 300.0 * std::sin(0.5 * 140.0 / 300.0);
    curve.turn_rad = 140.0 / 300.0;
    curve.tangent_m = 300.0 * std::tan(0.5 * 140.0 / 300.0);
    d.plan[0].stated.bearing_start_rad = M_PI / 2.0 - 0.4;
    d.plan[kClothoid].stated.clothoid_constant_m = std::sqrt(60.0 * 300.0);
    d.stated_length_m = 700.0;
  });
  EXPECT_TRUE(right.empty());
  const AxisRemarks square = After(
      [](AxisDescription& d) { d.plan[kClothoid].stated.clothoid_constant_m = 60.0 * 300.0; });
  EXPECT_TRUE(square.empty()) << "A squared is in use as well";
  const AxisRemarks whole = After([](AxisDescription& d) { d.stated_length_m = 700.1; });
  ASSERT_EQ(whole.size(), 1u);
  EXPECT_EQ(whole[0].quantity, StatedQuantity::kAlignmentLength);
  const AxisRemarks station =
      After([](AxisDescription& d) { d.plan[3].stated.start_chainage_m = 1281.0; });
  ASSERT_EQ(station.size(), 1u);
  EXPECT_EQ(station[0].code, AxisRemarkCode::kStationDisagrees);
}

TEST(Inspect, RecognisesOtherConventionsOfAngles) {
  const AxisRemarks east =
      After([](AxisDescription& d) { d.plan[0].stated.bearing_start_rad = 0.4; });
  ASSERT_EQ(east.size(), 1u);
  EXPECT_EQ(east[0].code, AxisRemarkCode::kBearingConvention);
  const AxisRemarks unit = After(
      [](AxisDescription& d) { d.plan[kCurve].stated.turn_rad = 140.0 / 300.0 * 180.0 / M_PI; });
  ASSERT_EQ(unit.size(), 1u);
  EXPECT_EQ(unit[0].code, AxisRemarkCode::kAngleUnit);
  EXPECT_NEAR(unit[0].size, M_PI / 180.0, 1e-12);
}

// InfraModel writes the extent along the tangent as the length of a biquadratic parabola.
TEST(Inspect, RecognisesALengthAlongTheTangent) {
  AxisDescription description;
  SpiralElement spiral;
  const double radius_m = 400.0;
  const double extent_m = 120.0;
  spiral.end = {extent_m, 7.0 * extent_m * extent_m / (48.0 * radius_m)};
  spiral.law = SpiralLaw::kBiquadraticParabola;
  spiral.length_m = extent_m;
  spiral.curvature_end_per_m = 1.0 / radius_m;
  description.plan = {{spiral, {}, 5}};
  description.plan[0].stated.length_m = extent_m;
  const AxisRemarks remarks = Inspect(description);
  ASSERT_EQ(remarks.size(), 1u);
  EXPECT_EQ(remarks[0].code, AxisRemarkCode::kLengthAlongTangent);
  const auto axis = DesignAxis::Build(description);
  ASSERT_TRUE(axis.has_value());
  EXPECT_NEAR(axis->end().m, extent_m, 1e-9) << "chainage as the file counts it";
}

TEST(Inspect, LooksAtTheProfile) {
  const auto with = [](std::vector<ProfileElement> profile) {
    return After([&](AxisDescription& d) { d.profile = profile; });
  };
  const auto point =
      [](double at_m, double up_m, ProfileKind kind, double in, double out, double r) {
        return ProfileElement{kind, {at_m}, up_m, in, out, r, 40};
      };
  const auto pvi = [&](double at_m, double up_m) {
    return point(at_m, up_m, ProfileKind::kPoint, 0.0, 0.0, 0.0);
  };
  const auto only = [](const AxisRemarks& remarks) {
    EXPECT_EQ(remarks.size(), 1u);
    return remarks.empty() ? AxisRemarkCode::kNoPlan : remarks[0].code;
  };
  EXPECT_TRUE(with({pvi(1000, 5), pvi(1700, 9)}).empty());
  EXPECT_EQ(only(with({pvi(1000, 5), pvi(1000, 6)})), AxisRemarkCode::kProfileOrder);
  EXPECT_EQ(only(with({pvi(1000, 5)})), AxisRemarkCode::kProfileOrder);
  EXPECT_EQ(only(with({pvi(1000, 5), pvi(1300, 8), pvi(1700, 9)})), AxisRemarkCode::kProfileKink);
  EXPECT_EQ(only(with({pvi(990, 5), pvi(1700, 9)})), AxisRemarkCode::kProfileOutside);
  EXPECT_EQ(only(with({pvi(1000, 5), pvi(1690, 9)})), AxisRemarkCode::kProfileShort);
  EXPECT_EQ(only(with({pvi(1000, std::nan("")), pvi(1700, 9)})), AxisRemarkCode::kProfileNotFinite);
  const auto parabola = [&](double at_m, double up_m, double length_m) {
    return point(at_m, up_m, ProfileKind::kParabola, length_m, 0.0, 0.0);
  };
  EXPECT_EQ(only(with({parabola(1000, 5, 10), pvi(1700, 9)})), AxisRemarkCode::kProfileCurveAtEnd);
  EXPECT_EQ(
      only(with({pvi(1000, 5), parabola(1300, 8, 500), parabola(1600, 8, 150), pvi(1700, 9)})),
      AxisRemarkCode::kProfileOverlap);
  EXPECT_EQ(
      only(with({pvi(1000, 5), point(1300, 8, ProfileKind::kCircle, 0.0, 0.0, 0.0), pvi(1700, 9)})),
      AxisRemarkCode::kProfileCircle);
  EXPECT_EQ(
      only(with(
          {pvi(1000, 5), point(1300, 8, ProfileKind::kCircle, 90.0, 0.0, 4000.0), pvi(1700, 9)})),
      AxisRemarkCode::kProfileLength);
}

TEST(Inspect, LooksAtCantAndEquations) {
  const auto with = [](std::vector<CantStation> cant, double gauge_m) {
    return After([&](AxisDescription& d) {
      d.cant = cant;
      d.gauge_m = gauge_m;
    });
  };
  const auto first = [](const AxisRemarks& remarks) {
    return remarks.empty() ? AxisRemarkCode::kNoPlan : remarks[0].code;
  };
  EXPECT_TRUE(with({{{1080}, 0.0, 1}, {{1140}, 0.1, 2}}, 1.5).empty());
  EXPECT_EQ(first(with({{{1080}, 0.0, 1}, {{1140}, 0.1, 2}}, 0.0)), AxisRemarkCode::kCantGauge);
  EXPECT_EQ(first(with({{{1080}, 0.0, 1}, {{1080}, 0.1, 2}}, 1.5)), AxisRemarkCode::kCantOrder);
  EXPECT_EQ(first(with({{{1080}, 0.0, 1}, {{1140}, 0.6, 2}}, 1.5)), AxisRemarkCode::kCantTooLarge);
  EXPECT_EQ(first(with({{{1080}, 0.0, 1}, {{1081}, 0.1, 2}}, 1.5)), AxisRemarkCode::kCantJump);
  EXPECT_EQ(first(with({{{1080}, 0.0, 1}, {{1200}, -0.1, 2}}, 1.5)), AxisRemarkCode::kCantWrongWay);
  const auto equations = [](std::vector<StationEquation> list) {
    return After([&](AxisDescription& d) { d.equations = list; });
  };
  EXPECT_TRUE(equations({{{1300.0}, 1350.0, true, 1300.0, 1}}).empty());
  EXPECT_EQ(first(equations({{{1300.0}, 1350.0, true, 1310.0, 1}})), AxisRemarkCode::kEquationBack);
  EXPECT_EQ(first(equations({{{900.0}, 1350.0, true, {}, 1}})), AxisRemarkCode::kEquationOutside);
  EXPECT_EQ(first(equations({{{1300.0}, 1350.0, true, {}, 1}, {{1200.0}, 10.0, true, {}, 2}})),
            AxisRemarkCode::kEquationOrder);
}

AxisRemarks TableAfter(const std::function<void(std::vector<TablePoint>&)>& spoil) {
  const MadeAxis made = Drive();
  std::vector<double> lengths_m;
  for (int i = 0; i <= 300; ++i) lengths_m.push_back(i);
  AxisDescription description;
  int line = 2;
  for (const auto& state : made.States(lengths_m)) {
    const double at_m = lengths_m[static_cast<std::size_t>(line - 2)];
    description.table.push_back({made.Place(state), 100.0 - 0.01 * at_m, at_m, line});
    ++line;
  }
  spoil(description.table);
  return Inspect(description);
}

TEST(Inspect, LooksAtTables) {
  using Table = std::vector<TablePoint>;
  const auto first = [](const AxisRemarks& remarks) {
    return remarks.empty() ? AxisRemarkCode::kNoPlan : remarks[0].code;
  };
  EXPECT_TRUE(TableAfter([](Table&) {}).empty());
  const AxisRemarks out = TableAfter([](Table& t) { t[150].plan.y() += 0.03; });
  ASSERT_EQ(first(out), AxisRemarkCode::kTableChainage) << "the way is longer there";
  const AxisRemark* sticks = Find(out, AxisRemarkCode::kTableSticksOut);
  ASSERT_NE(sticks, nullptr);
  EXPECT_EQ(sticks->line, 152);
  EXPECT_NEAR(sticks->size, 0.03, 2e-3);
  EXPECT_EQ(first(TableAfter([](Table& t) { t.erase(t.begin() + 40, t.begin() + 44); })),
            AxisRemarkCode::kTableSpacing);
  EXPECT_EQ(first(TableAfter([](Table& t) { t[10].up_m.reset(); })), AxisRemarkCode::kTableMixed);
  EXPECT_EQ(first(TableAfter([](Table& t) { t[10].chainage_m = 3.0; })),
            AxisRemarkCode::kTableChainage);
  EXPECT_EQ(first(TableAfter([](Table& t) { t[10].plan = t[9].plan; })), AxisRemarkCode::kNoLength);
  EXPECT_EQ(first(TableAfter([](Table& t) { t.resize(1); })), AxisRemarkCode::kNoPlan);
  EXPECT_EQ(first(TableAfter([](Table& t) { t[20].plan.y() = std::nan(""); })),
            AxisRemarkCode::kNotFinite);
  EXPECT_EQ(first(TableAfter([](Table& t) { std::swap(t[20].plan, t[22].plan); })),
            AxisRemarkCode::kTurnsTooFar);
  const AxisRemarks rounded = TableAfter([](Table& t) {
    for (TablePoint& point : t) point.plan = (point.plan * 1000.0).array().round() / 1000.0;
  });
  ASSERT_NE(Find(rounded, AxisRemarkCode::kTableRounded), nullptr);
  EXPECT_NEAR(Find(rounded, AxisRemarkCode::kTableRounded)->stated, 0.001, 1e-12);
  EXPECT_EQ(rounded.size(), 1u) << "a millimetre of rounding is nothing else";
}

TEST(Inspect, RefusesAnEmptyDescription) {
  const AxisRemarks remarks = Inspect({});
  ASSERT_EQ(remarks.size(), 1u);
  EXPECT_EQ(remarks[0].code, AxisRemarkCode::kNoPlan);
  EXPECT_EQ(remarks[0].severity, Severity::kRefused);
}

}  // namespace
}  // namespace tbm
