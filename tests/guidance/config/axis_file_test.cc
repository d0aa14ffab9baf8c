#include "guidance/config/axis_file.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/axis/design_axis.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using test::ReadText;
using ::testing::HasSubstr;

const std::string kAxisFolder = TBM_SOURCE_DIR "/tests/data/axis/";
const std::string kBadFolder = TBM_SOURCE_DIR "/tests/data/config_bad/";

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}
std::string ReplacedAll(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
    text.replace(at, from.size(), to);
  }
  return text;
}

std::string Example() { return ReadText(kAxisFolder + "example.xml"); }

LoadedAxis Loaded(const std::string& text, const AxisFileOptions& options = {}) {
  auto loaded = ParseAxis(text, "axis.xml", options);
  if (!loaded) {
    ADD_FAILURE() << loaded.error().front().Text();
    return {};
  }
  return std::move(loaded).value();
}

DesignAxis Built(const LoadedAxis& loaded) {
  auto axis = DesignAxis::Build(loaded.description);
  if (!axis) {
    for (const AxisRemark& remark : axis.error()) ADD_FAILURE() << RemarkText(remark, "axis.xml");
    std::abort();
  }
  return std::move(axis).value();
}

struct BadFile {
  const char* name;
  int line;
  const char* place;
};

constexpr BadFile kBadFiles[] = {
    {"alignments_missing.xml", 2, ""},
    {"alignments_two.xml", 2, ""},
    {"angular_unit_unknown.xml", 4, "Units/Metric/@angularUnit"},
    {"cant_applied_word.xml", 18, "Alignments 1/Alignment 1/Cant/CantStation 2/@appliedCant"},
    {"cant_curvature_unknown.xml", 17, "Alignments 1/Alignment 1/Cant/CantStation 1/@curvature"},
    {"cant_gauge_missing.xml", 16, "Alignments 1/Alignment 1/Cant/@gauge"},
    {"cant_pivot_unknown.xml", 16, "Alignments 1/Alignment 1/Cant/@rotationPoint"},
    {"cant_station_missing.xml", 17, "Alignments 1/Alignment 1/Cant/CantStation 1/@station"},
    {"circle_radius_missing.xml",
     25,
     "Alignments 1/Alignment 1/Profile 1/ProfAlign 1/CircCurve 1/@radius"},
    {"circle_radius_zero.xml",
     25,
     "Alignments 1/Alignment 1/Profile 1/ProfAlign 1/CircCurve 1/@radius"},
    {"coord_geom_empty.xml", 9, "Alignments 1/Alignment 1/CoordGeom"},
    {"coord_geom_missing.xml", 8, "Alignments 1/Alignment 1"},
    {"curve_centre_and_radius_missing.xml", 13, "Alignments 1/Alignment 1/CoordGeom/Curve 1"},
    {"curve_rot_missing.xml", 13, "Alignments 1/Alignment 1/CoordGeom/Curve 1/@rot"},
    {"dir_word.xml", 10, "Alignments 1/Alignment 1/CoordGeom/Line 1/@dir"},
    {"element_unknown.xml", 10, "Alignments 1/Alignment 1/CoordGeom/Polyline 1"},
    {"equation_ahead_missing.xml", 29, "Alignments 1/Alignment 1/StaEquation 1/@staAhead"},
    {"equation_increment_unknown.xml", 29, "Alignments 1/Alignment 1/StaEquation 1/@staIncrement"},
    {"equation_internal_missing.xml", 29, "Alignments 1/Alignment 1/StaEquation 1/@staInternal"},
    {"linear_unit_missing.xml", 4, "Units/Metric/@linearUnit"},
    {"linear_unit_unknown.xml", 4, "Units/Metric/@linearUnit"},
    {"not_xml.xml", 15, ""},
    {"other_root.xml", 2, ""},
    {"para_curve_length_missing.xml",
     23,
     "Alignments 1/Alignment 1/Profile 1/ProfAlign 1/ParaCurve 1/@length"},
    {"pnt_ref_unknown.xml", 10, "Alignments 1/Alignment 1/CoordGeom/Line 1/Start/@pntRef"},
    {"profile_element_unknown.xml", 22, "Alignments 1/Alignment 1/Profile 1/ProfAlign 1/PVJ 1"},
    {"profile_one_number.xml", 22, "Alignments 1/Alignment 1/Profile 1/ProfAlign 1/PVI 1"},
    {"profiles_two.xml", 8, "Alignments 1/Alignment 1"},
    {"spiral_length_missing.xml", 11, "Alignments 1/Alignment 1/CoordGeom/Spiral 1/@length"},
    {"spiral_length_negative.xml", 11, "Alignments 1/Alignment 1/CoordGeom/Spiral 1/@length"},
    {"spiral_radius_missing.xml", 11, "Alignments 1/Alignment 1/CoordGeom/Spiral 1/@radiusStart"},
    {"spiral_radius_word.xml", 11, "Alignments 1/Alignment 1/CoordGeom/Spiral 1/@radiusStart"},
    {"spiral_radius_zero.xml", 11, "Alignments 1/Alignment 1/CoordGeom/Spiral 1/@radiusStart"},
    {"spiral_rot_left.xml", 11, "Alignments 1/Alignment 1/CoordGeom/Spiral 1/@rot"},
    {"spiral_type_missing.xml", 11, "Alignments 1/Alignment 1/CoordGeom/Spiral 1/@spiType"},
    {"spiral_type_radioid.xml", 11, "Alignments 1/Alignment 1/CoordGeom/Spiral 1/@spiType"},
    {"spiral_type_rev_bloss.xml", 11, "Alignments 1/Alignment 1/CoordGeom/Spiral 1/@spiType"},
    {"spiral_type_unknown.xml", 11, "Alignments 1/Alignment 1/CoordGeom/Spiral 1/@spiType"},
    {"sta_start_formatted.xml", 8, "Alignments 1/Alignment 1/@staStart"},
    {"sta_start_missing.xml", 8, "Alignments 1/Alignment 1/@staStart"},
    {"start_missing.xml", 10, "Alignments 1/Alignment 1/CoordGeom/Line 1"},
    {"start_nan.xml", 10, "Alignments 1/Alignment 1/CoordGeom/Line 1/Start"},
    {"start_one_number.xml", 10, "Alignments 1/Alignment 1/CoordGeom/Line 1/Start"},
    {"start_with_comma.xml", 10, "Alignments 1/Alignment 1/CoordGeom/Line 1/Start"},
    {"table_column_missing.csv", 1, "column north_m"},
    {"table_empty.csv", 0, ""},
    {"table_field_missing.csv", 3, ""},
    {"table_infinite.csv", 3, "column up_m"},
    {"table_no_points.csv", 1, ""},
    {"table_one_point.csv", 2, "column east_m"},
    {"table_semicolons.csv", 1, "column east_m"},
    {"table_word.csv", 3, "column north_m"},
    {"units_empty.xml", 3, "Units"},
    {"units_missing.xml", 2, ""},
    {"unsym_length_in_negative.xml",
     24,
     "Alignments 1/Alignment 1/Profile 1/ProfAlign 1/UnsymParaCurve 1/@lengthIn"},
    {"unsym_length_out_missing.xml",
     24,
     "Alignments 1/Alignment 1/Profile 1/ProfAlign 1/UnsymParaCurve 1/@lengthOut"},
    {"utf16.xml", 0, ""},
};

TEST(AxisFile, ReadsTheExampleWithoutARemark) {
  const auto loaded = LoadAxisFile(kAxisFolder + "example.xml", {});
  ASSERT_TRUE(loaded.has_value()) << loaded.error().front().Text();
  EXPECT_TRUE(loaded->warnings.empty());
  for (const AxisRemark& remark : Inspect(loaded->description)) {
    ADD_FAILURE() << RemarkText(remark, "example.xml");
  }
  const DesignAxis axis = Built(*loaded);
  EXPECT_EQ(axis.name(), "north tube");
  EXPECT_DOUBLE_EQ(axis.start().m, 10000.0);
  EXPECT_NEAR(axis.end().m, 10800.0, 1e-9);
  // what sha256sum says of these bytes
  EXPECT_EQ(Loaded("east_m,north_m\n0,0\n1,0\n").description.file_sha256,
            "421a1a4e7cc0cef51cc37b825bc1b98518af32b19869fc9829dbb88ba87bf6a9");
}

// example_table.csv and example_shots.csv were computed beside the file, not from it.
TEST(AxisFile, ExampleGivesThePlacesItWasMadeWith) {
  const DesignAxis axis = Built(Loaded(Example()));
  const auto table = Loaded(ReadText(kAxisFolder + "example_table.csv"));
  ASSERT_EQ(table.description.table.size(), 301u);
  for (const TablePoint& point : table.description.table) {
    const auto at = axis.At({*point.chainage_m});
    ASSERT_TRUE(at.has_value());
    EXPECT_LT((at->p_plan_in_site - point.plan).norm(), 3e-7) << *point.chainage_m;
    ASSERT_TRUE(at->up_m.has_value());
    EXPECT_NEAR(*at->up_m, *point.up_m, 2e-7) << *point.chainage_m;
  }
}

TEST(AxisFile, TableAndElementsAreTheSameAxis) {
  const DesignAxis elements = Built(Loaded(Example()));
  const DesignAxis table = Built(Loaded(ReadText(kAxisFolder + "example_table.csv")));
  for (double chainage_m = 10002.3; chainage_m < 10298.0; chainage_m += 7.7) {
    const auto a = elements.At({chainage_m});
    const auto b = table.At({chainage_m});
    EXPECT_LT((*a->p_in_site() - *b->p_in_site()).norm(), 2e-6) << chainage_m;
    EXPECT_NEAR(a->bearing_rad, b->bearing_rad, 2e-6) << chainage_m;
    EXPECT_NEAR(*a->gradient, *b->gradient, 2e-6) << chainage_m;
  }
}

TEST(AxisFile, TakesHeightsCantAndEquationsInTheUnitsOfTheFile) {
  const DesignAxis axis = Built(Loaded(Example()));
  const auto point = axis.At({10250.0});
  ASSERT_TRUE(point && point->cant);
  EXPECT_NEAR(point->cant->left_over_right_m, 0.110, 1e-12);
  EXPECT_NEAR(point->cant->roll_rad, std::asin(0.110 / 1.5), 1e-12);
  EXPECT_NEAR(axis.At({10150.0})->cant->left_over_right_m, 0.055, 1e-12);
  EXPECT_NEAR(axis.At({10600.0})->cant->left_over_right_m, -0.080, 1e-12) << "left-hand curve";
  EXPECT_FALSE(axis.At({10050.0})->cant.has_value()) << "no cant is stated there";
  EXPECT_EQ(axis.At({10310.0})->official, (OfficialChainage{10360.0, 1}));
  EXPECT_EQ(axis.At({10655.0})->official, (OfficialChainage{10685.0, 2}));
}

TEST(AxisFile, AdverseCantTurnsRoundAndEquationsMayStandInAnyOrder) {
  std::string text = Replaced(Example(),
                              "appliedCant=\"80\" curvature=\"ccw\"",
                              "appliedCant=\"80\" curvature=\"ccw\" adverse=\"true\"");
  const std::size_t first = text.find("      <StaEquation");
  const std::size_t second = text.find("      <StaEquation", first + 1);
  const std::size_t end = text.find("      <CoordGeom>");
  text = text.substr(0, first) + text.substr(second, end - second) +
         text.substr(first, second - first) + text.substr(end);
  const DesignAxis axis = Built(Loaded(text));
  EXPECT_NEAR(axis.At({10540.0})->cant->left_over_right_m, 0.080, 1e-12);
  EXPECT_NEAR(axis.At({10640.0})->cant->left_over_right_m, -0.080, 1e-12);
  EXPECT_EQ(axis.At({10310.0})->official, (OfficialChainage{10360.0, 1}));
  EXPECT_EQ(axis.At({10655.0})->official, (OfficialChainage{10685.0, 2}));
}

// Northing and easting, metres and feet, degrees and grads: the same axis.
std::string InFeet(const std::string& xml, double metres_per_foot) {
  std::string out;
  // Numbers outside of the angles and the cant; angles keep their attribute names.
  for (std::size_t at = 0; at < xml.size();) {
    const bool is_angle = out.ends_with("dir=\"") || out.ends_with("dirStart=\"") ||
                          out.ends_with("dirEnd=\"") || out.ends_with("delta=\"") ||
                          out.ends_with("theta=\"");
    const bool is_cant = out.ends_with("appliedCant=\"");
    const bool starts_number = std::isdigit(static_cast<unsigned char>(xml[at])) != 0 &&
                               (out.ends_with("\"") || out.ends_with(">") || out.ends_with(" ")) &&
                               at > 300;
    if (!starts_number) {
      out += xml[at++];
      continue;
    }
    std::size_t used = 0;
    const double number = std::stod(xml.substr(at, 30), &used);
    const double value = is_angle ? number : is_cant ? number / 25.4 : number / metres_per_foot;
    char text[64];
    std::snprintf(text, sizeof text, "%.11f", value);
    out += text;
    at += used;
  }
  return out;
}

TEST(AxisFile, FeetGiveTheSameMetres) {
  const DesignAxis metric = Built(Loaded(Example()));
  struct Foot {
    const char* unit;
    double size_m;
  };
  for (const Foot& foot : {Foot{"foot", 0.3048}, Foot{"USSurveyFoot", 1200.0 / 3937.0}}) {
    const std::string imperial =
        Replaced(Replaced(InFeet(Example(), foot.size_m), "<Metric", "<Imperial"),
                 "linearUnit=\"meter\"",
                 std::string("linearUnit=\"") + foot.unit + "\"");
    const auto loaded = Loaded(imperial);
    for (const AxisRemark& remark : Inspect(loaded.description)) {
      ADD_FAILURE() << RemarkText(remark, foot.unit);
    }
    const DesignAxis axis = Built(loaded);
    for (double chainage_m = 10000.0; chainage_m < 10800.0; chainage_m += 33.0) {
      const auto a = metric.At({chainage_m});
      const auto b = axis.At({chainage_m});
      ASSERT_TRUE(a && b);
      EXPECT_LT((*a->p_in_site() - *b->p_in_site()).norm(), 1e-8);
      if (a->cant) {
        EXPECT_NEAR(a->cant->left_over_right_m, b->cant->left_over_right_m, 1e-12);
      }
    }
  }
}

// Redundant angles are compared with the geometry: read in a wrong form, each would be a remark.
TEST(AxisFile, EveryFormOfAngleIsHonoured) {
  const std::string xml = ReadText(kBadFolder + "axis_good.xml");
  const auto with = [&](const char* form, const char* value) {
    const std::string text = ReplacedAll(xml, "decimal degrees", form);
    // The line's bearing is 30 degrees; the other angles are dropped.
    std::string out = Replaced(text, "dir=\"30.000000000\"", std::string("dir=\"") + value + "\"");
    for (const char* name : {"theta", "delta", "dirStart", "dirEnd"}) {
      const std::string key = std::string(" ") + name + "=\"";
      for (std::size_t at = 0; (at = out.find(key, at)) != std::string::npos;) {
        out.erase(at, out.find('"', at + key.size()) + 1 - at);
      }
    }
    return Inspect(Loaded(out).description);
  };
  EXPECT_TRUE(with("decimal degrees", "30.0").empty());
  EXPECT_TRUE(with("radians", "0.5235987755983").empty());
  EXPECT_TRUE(with("grads", "33.3333333333").empty());
  EXPECT_TRUE(with("decimal dd.mm.ss", "29.5960").empty()) << "29 degrees 59 minutes 60 seconds";
  EXPECT_TRUE(with("decimal dd.mm.ss", "30.00").empty());
  EXPECT_TRUE(with("decimal dd.mm.ss", "-330.0000").empty());
  EXPECT_EQ(with("decimal dd.mm.ss", "30.3000").size(), 1u) << "30 degrees 30 minutes";
  EXPECT_EQ(with("grads", "30.0").size(), 1u);
}

TEST(AxisFile, ARadiusBeyondAllTunnelsIsStraight) {
  const std::string xml =
      ReadText(TBM_SOURCE_DIR "/tests/fuzz/seeds/axis_file_fuzz/japaneseCubic.xml");
  const DesignAxis axis = Built(Loaded(Replaced(xml, "INF", "1e38")));
  EXPECT_EQ(axis.At({50.0})->p_plan_in_site, Built(Loaded(xml)).At({50.0})->p_plan_in_site);
}

TEST(AxisFile, PointsOfAnElementMayStandInAnyOrder) {
  std::string text = Example();
  const DesignAxis axis = Built(Loaded(text));
  int moved = 0;
  // Start becomes the last child of every element that has more than two.
  for (std::size_t at = 0; (at = text.find("\n          <Start>", at)) != std::string::npos;
       ++moved) {
    const std::size_t begin = text.find("<Start>", at);
    const std::size_t end = text.find("</Start>", at) + 8;
    const std::string start = text.substr(begin, end - begin);
    const std::size_t last = text.find("</End>", end) + 6;
    text = text.substr(0, begin) + text.substr(end, last - end) + start + text.substr(last);
    at = last;
  }
  EXPECT_EQ(moved, 6);
  const DesignAxis other = Built(Loaded(text));
  for (double chainage_m = 10000.0; chainage_m <= 10800.0; chainage_m += 50.0) {
    EXPECT_EQ(axis.At({chainage_m})->p_plan_in_site, other.At({chainage_m})->p_plan_in_site);
  }
}

TEST(AxisFile, SubtractsTheOriginOfTheSite) {
  AxisFileOptions options;
  options.site_origin = {4000.0, 12000.0, 400.0};
  const DesignAxis axis = Built(Loaded(Example(), options));
  const Eigen::Vector3d start = *axis.At(axis.start())->p_in_site();
  EXPECT_LT((start - Eigen::Vector3d(512.4, 87.65, 12.0)).norm(), 1e-9);
}

TEST(AxisFile, ChoosesAlignmentAndProfileByName) {
  const std::string two = ReadText(kBadFolder + "axis/alignments_two.xml");
  AxisFileOptions options;
  options.alignment = "other";
  EXPECT_EQ(Loaded(two, options).description.name, "other");
  options.alignment = "third";
  const auto none = ParseAxis(two, "axis.xml", options);
  ASSERT_FALSE(none.has_value());
  EXPECT_THAT(none.error()[0].Text(), HasSubstr("'small', 'other'"));
  options = {};
  options.profile = "ground";
  EXPECT_EQ(Loaded(ReadText(kBadFolder + "axis/profiles_two.xml"), options).description.name,
            "small");
}

TEST(AxisFile, TakesPrefixesReferencesAndPolylines) {
  const auto loaded = Loaded(
      "<l:LandXML xmlns:l=\"http://www.landxml.org/schema/LandXML-1.2\">"
      "<l:Units><l:Metric linearUnit=\"millimeter\"/></l:Units>"
      "<l:CgPoints><l:CgPoint name=\"A\">1000 0</l:CgPoint><l:CgPoint name=\"B\">2000 0</l:CgPoint>"
      "</l:CgPoints><l:Alignments><l:Alignment name=\"a\" staStart=\"0\"><l:CoordGeom>"
      "<l:Line><l:Start pntRef=\"B\">0 0</l:Start><l:End pntRef=\"A\"/></l:Line>"
      "<l:Chain>A B</l:Chain>"
      "<l:IrregularLine><l:PntList3D>2000 0 5 2500 0 6\n3000 100 7</l:PntList3D></l:IrregularLine>"
      "</l:CoordGeom></l:Alignment></l:Alignments></l:LandXML>");
  ASSERT_EQ(loaded.description.plan.size(), 4u);
  EXPECT_EQ(loaded.warnings.size(), 1u) << "no heights";
  const DesignAxis axis = Built(loaded);
  EXPECT_LT((axis.At({0.5})->p_plan_in_site - Eigen::Vector2d(0.0, 0.5)).norm(), 1e-12)
      << "coordinates win";
  EXPECT_NEAR(axis.end().m, 2.5 + std::hypot(0.5, 0.1), 1e-12);
  EXPECT_FALSE(axis.At({0.5})->up_m.has_value());
}

// Each file holds one spiral that leaves the north direction to the right; its end was computed by
// a Simpson rule from the published formula. Under another law the chord would turn the start away.
TEST(AxisFile, ReadsEverySpiralTypeThatHasAFormula) {
  for (const char* type : {"clothoid",
                           "bloss",
                           "cosine",
                           "sinusoid",
                           "biquadratic",
                           "weinerBogen",
                           "cubic",
                           "cubicParabola",
                           "japaneseCubic",
                           "sineHalfWave",
                           "biquadraticParabola"}) {
    SCOPED_TRACE(type);
    const auto loaded = Loaded(
        ReadText(std::string(TBM_SOURCE_DIR "/tests/fuzz/seeds/axis_file_fuzz/") + type + ".xml"));
    EXPECT_TRUE(Inspect(loaded.description).empty());
    const DesignAxis axis = Built(loaded);
    const auto start = axis.At(axis.start());
    const auto end = axis.At(axis.end());
    EXPECT_NEAR(std::remainder(start->bearing_rad, 2.0 * M_PI), 0.0, 1e-9);
    EXPECT_NEAR(start->curvature_right_per_m, 0.0, 1e-9);
    EXPECT_GT(end->bearing_rad, 0.1) << "cw is to the right";
    EXPECT_GT(end->curvature_right_per_m, 0.9 / 400.0);
  }
}

TEST(AxisFile, EachBadFileNamesItsLineAndPlace) {
  for (const BadFile& bad : kBadFiles) {
    SCOPED_TRACE(bad.name);
    const std::string path = kBadFolder + "axis/" + bad.name;
    const auto loaded = LoadAxisFile(path, {});
    ASSERT_FALSE(loaded.has_value());
    ASSERT_FALSE(loaded.error().empty());
    const AxisFileFault& fault = loaded.error().front();
    EXPECT_EQ(fault.line, bad.line);
    EXPECT_EQ(fault.place, bad.place);
    EXPECT_EQ(fault.file, path);
    EXPECT_GT(fault.what.size(), 15u) << fault.what;
  }
}

TEST(AxisFile, EveryBadFileIsInTheListAndTheGoodOneIsGood) {
  std::set<std::string> listed;
  for (const BadFile& bad : kBadFiles) listed.insert(bad.name);
  std::set<std::string> present;
  for (const auto& entry : std::filesystem::directory_iterator(kBadFolder + "axis")) {
    present.insert(entry.path().filename().string());
  }
  EXPECT_EQ(listed, present);
  const auto good = LoadAxisFile(kBadFolder + "axis_good.xml", {});
  ASSERT_TRUE(good.has_value());
  EXPECT_TRUE(Inspect(good->description).empty());
}

TEST(AxisFile, CollectsAllFaultsAtOnce) {
  std::string text = Replaced(Example(), "rot=\"cw\" radiusStart", "radiusStart");
  text = Replaced(text, "gauge=\"1.5000\"", "gauge=\"wide\"");
  text = Replaced(text, "staAhead=\"10680.0000\"", "");
  const auto loaded = ParseAxis(text, "axis.xml", {});
  ASSERT_FALSE(loaded.has_value());
  EXPECT_EQ(loaded.error().size(), 3u);
}

TEST(AxisFile, EveryRemarkHasACodeAndASentence) {
  std::set<std::string> codes;
  for (int code = 1; code < 70; ++code) {
    AxisRemark remark;
    remark.code = static_cast<AxisRemarkCode>(code);
    const std::string_view name = RemarkCode(remark.code);
    if (name.empty()) continue;
    EXPECT_TRUE(codes.insert(std::string(name)).second) << name;
    EXPECT_GT(RemarkText(remark, "").size(), std::string("chainage 0.000 m: ").size() + 10) << name;
  }
  EXPECT_EQ(codes.size(), 43u);
}

// What a broken transfer leaves must never bring the reader down.
TEST(AxisFile, SurvivesCutFlippedAndGluedText) {
  const std::string good = ReadText(kBadFolder + "axis_good.xml");
  const auto read = [](const std::string& text) {
    const auto loaded = ParseAxis(text, "axis.xml", {});
    if (!loaded) {
      EXPECT_FALSE(loaded.error().empty());
      return false;
    }
    return DesignAxis::Build(loaded->description).has_value();
  };
  EXPECT_TRUE(read(good));
  for (std::size_t size = 0; size + 12 < good.size(); ++size) {
    EXPECT_FALSE(read(good.substr(0, size))) << size;
  }
  for (std::size_t at = 0; at < good.size(); at += 2) {
    std::string flipped = good;
    flipped[at] = static_cast<char>(flipped[at] ^ (1 << (at / 2 % 8)));
    (void)read(flipped);
  }
  EXPECT_TRUE(read(good + "\n<!-- more -->"));
  EXPECT_FALSE(read("garbage\n" + good));
  EXPECT_FALSE(read(std::string(100'000, '<')));
  std::string deep;
  for (int i = 0; i < 20'000; ++i) deep += "<a>";
  EXPECT_FALSE(read(deep));
  const std::string table = ReadText(kAxisFolder + "example_table.csv").substr(0, 1200);
  for (std::size_t size = 0; size < table.size(); ++size) (void)read(table.substr(0, size));
  EXPECT_FALSE(read(table + table)) << "chainages go back";
}

}  // namespace
}  // namespace tbm
