#include "pose/calibrate/camera_calibration.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "pose/calibrate/board_pose.h"
#include "pose/calibrate/find_board.h"
#include "tests/support/board_picture.h"
#include "tests/support/random.h"

namespace tbm {
namespace {

using test::BoardCamera;
using test::BoardPainter;
using test::BoardPlace;
using test::GoodPlacements;
using test::Placed;
using test::Random;
using test::TruePixels;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

using Views = std::vector<std::vector<Eigen::Vector2d>>;

Board BoardFrom(std::string_view text) {
  const auto board = ParseBoard(text);
  EXPECT_TRUE(board.has_value()) << text;
  return *board;
}
const Board kChess = BoardFrom("chessboard:9x6:25");
const Board kCircles = BoardFrom("circles:8x6:30:14");
const Board kAsymmetric = BoardFrom("asymmetric_circles:4x9:20:14");

Views NoisyViews(const Board& board,
                 const CameraModel& camera,
                 const std::vector<Rigid3>& placements,
                 double sigma_px,
                 Random& random) {
  Views views;
  for (const Rigid3& placement : placements) {
    auto& pixels = views.emplace_back(TruePixels(board, camera, placement));
    for (Eigen::Vector2d& pixel : pixels) pixel += random.Normal2(sigma_px);
  }
  return views;
}

Result<CameraCalibration, CameraCalibrationFailure> Calibrated(
    const Board& board, const Views& views, const CameraCalibrationOptions& options = {}) {
  return CalibrateCamera(board, views, 640, 480, options);
}

Eigen::Matrix<double, 8, 1> ErrorOf(const CameraModel& found) {
  return (IntrinsicsOf(found) - IntrinsicsOf(BoardCamera())).head<8>();
}

double Nees(const CameraCalibration& found) {
  const Eigen::Matrix<double, 8, 1> error = ErrorOf(found.camera);
  const Eigen::Matrix<double, 8, 8> covariance = found.covariance.topLeftCorner<8, 8>();
  return error.dot(covariance.ldlt().solve(error));
}

TEST(Board, IsReadFromItsDescription) {
  EXPECT_EQ(kChess.kind, BoardKind::kChessboard);
  EXPECT_EQ(kChess.columns, 9);
  EXPECT_EQ(kChess.rows, 6);
  EXPECT_DOUBLE_EQ(kChess.pitch_m, 0.025);
  EXPECT_FALSE(kChess.diameter_m);
  EXPECT_DOUBLE_EQ(kCircles.diameter_m.value(), 0.014);
  const auto points = BoardPoints(kAsymmetric);
  ASSERT_EQ(points.size(), 36u);
  EXPECT_EQ(points[1], Eigen::Vector3d(0.04, 0.0, 0.0));
  EXPECT_EQ(points[4], Eigen::Vector3d(0.02, 0.02, 0.0)) << "the second row is moved aside";
}

TEST(Board, WhatIsWrongIsSaid) {
  const std::vector<std::pair<std::string_view, BoardFault>> cases = {
      {"", BoardFault::kForm},
      {"chessboard", BoardFault::kForm},
      {"chessboard:9x6", BoardFault::kForm},
      {"chessboard:9x6:25:1:2", BoardFault::kForm},
      {"chessboard:9*6:25", BoardFault::kForm},
      {"chess:9x6:25", BoardFault::kKind},
      {"Circles:9x6:25", BoardFault::kKind},
      {"chessboard:2x6:25", BoardFault::kSize},
      {"chessboard:9x65:25", BoardFault::kSize},
      {"chessboard:9.5x6:25", BoardFault::kSize},
      {"chessboard:99999999999999999999x6:25", BoardFault::kSize},
      {"chessboard:9x6:0", BoardFault::kPitch},
      {"chessboard:9x6:nan", BoardFault::kPitch},
      {"chessboard:9x6:25mm", BoardFault::kPitch},
      {"chessboard:9x6:25:10", BoardFault::kDiameter},
      {"circles:9x6:25:25", BoardFault::kDiameter},
      {"circles:9x6:25:inf", BoardFault::kDiameter},
      {"circles:9x6:25:-1", BoardFault::kDiameter}};
  for (const auto& [text, fault] : cases) {
    const auto board = ParseBoard(text);
    ASSERT_FALSE(board) << text;
    EXPECT_EQ(board.error(), fault) << text;
    EXPECT_GT(std::string_view(Advice(board.error())).size(), 20u);
  }
}

TEST(Board, TurnedByHalfATurnOnlySomeLookTheSame) {
  EXPECT_FALSE(LooksTheSameTurned(kChess));
  EXPECT_TRUE(LooksTheSameTurned(BoardFrom("chessboard:9x7:25")));
  EXPECT_TRUE(LooksTheSameTurned(kCircles));
  EXPECT_FALSE(LooksTheSameTurned(kAsymmetric));
  EXPECT_TRUE(LooksTheSameTurned(BoardFrom("asymmetric_circles:4x10:20")));
}

// Root mean square and largest distance between found and true points, in px.
struct FinderError {
  double rms_px = 0.0;
  double most_px = 0.0;
};
FinderError ErrorOfFinder(const Board& board, std::string_view stream, bool is_negative = false) {
  const CameraModel camera = BoardCamera();
  const BoardPainter painter(camera);
  Random random(stream);
  FinderError error;
  double squared = 0.0;
  double count = 0.0;
  for (const Rigid3& placement : GoodPlacements(board, camera, 6, random)) {
    const auto pixels = painter.Paint(board, placement, 2.0, random, is_negative);
    const auto found = FindBoard(painter.View(pixels), board);
    EXPECT_TRUE(found.has_value()) << "seen from " << placement.translation.transpose();
    if (!found) continue;
    const auto truth = TruePixels(board, camera, placement);
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const double off_px = ((*found)[i] - truth[i]).norm();
      squared += off_px * off_px;
      count += 2.0;
      error.most_px = std::max(error.most_px, off_px);
    }
  }
  error.rms_px = std::sqrt(squared / count);
  return error;
}

TEST(FindBoard, ChessboardCornersToASmallPartOfAPixel) {
  const FinderError error = ErrorOfFinder(kChess, "chess");
  EXPECT_LT(error.rms_px, 0.05);
  EXPECT_LT(error.most_px, 0.2);
}

TEST(FindBoard, CirclesToASmallPartOfAPixel) {
  Board upright = kCircles;
  const CameraModel camera = BoardCamera();
  const BoardPainter painter(camera);
  Random random("circles");
  for (const Rigid3& placement : GoodPlacements(upright, camera, 4, random)) {
    const auto pixels = painter.Paint(upright, placement, 2.0, random);
    auto found = FindBoard(painter.View(pixels), upright);
    ASSERT_TRUE(found.has_value());
    // Which end comes first is open on a grid that looks the same turned.
    auto points = *found;
    const auto truth = TruePixels(upright, camera, placement);
    if ((points[0] - truth[0]).norm() > 5.0) std::reverse(points.begin(), points.end());
    for (std::size_t i = 0; i < truth.size(); ++i) {
      EXPECT_LT((points[i] - truth[i]).norm(), 0.08) << i;
    }
  }
}

TEST(FindBoard, AsymmetricCirclesDarkOrBright) {
  EXPECT_LT(ErrorOfFinder(kAsymmetric, "asymmetric").most_px, 0.1);
  EXPECT_LT(ErrorOfFinder(kAsymmetric, "asymmetric bright", true).most_px, 0.1);
}

TEST(FindBoard, TheFirstPointIsTheSameHoweverTheBoardIsTurned) {
  const CameraModel camera = BoardCamera();
  const BoardPainter painter(camera);
  Random random("turned");
  for (const Board& board : {kChess, kAsymmetric}) {
    for (const double roll_deg : {0.0, 80.0, 170.0, -100.0}) {
      BoardPlace place;
      place.share = 0.4;
      place.tilt_u_deg = 12.0;
      place.roll_deg = roll_deg;
      const Rigid3 placement = Placed(board, camera, place);
      const auto pixels = painter.Paint(board, placement, 1.0, random);
      const auto found = FindBoard(painter.View(pixels), board);
      ASSERT_TRUE(found.has_value()) << roll_deg;
      const auto truth = TruePixels(board, camera, placement);
      EXPECT_LT((found->front() - truth.front()).norm(), 1.0) << roll_deg;
      EXPECT_LT((found->back() - truth.back()).norm(), 1.0) << roll_deg;
    }
  }
}

TEST(FindBoard, SixteenBitsAndPaddedRowsAreTheSamePicture) {
  const CameraModel camera = BoardCamera();
  const BoardPainter painter(camera);
  Random random("sixteen");
  const auto pixels = painter.Paint(kChess, Placed(kChess, camera, {}), 1.0, random);
  const auto plain = FindBoard(painter.View(pixels), kChess);
  constexpr int kPadding = 7;
  std::vector<std::uint16_t> wide;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    wide.push_back(static_cast<std::uint16_t>(pixels[i] * 16));
    if (i % 640 == 639) wide.insert(wide.end(), kPadding, 4080);
  }
  ImageView view = painter.View(pixels);
  view.pixels = wide.data();
  view.stride_bytes = 2 * (640 + kPadding);
  view.bytes_per_pixel = 2;
  view.max_value = 4080;
  const auto found = FindBoard(view, kChess);
  ASSERT_TRUE(plain && found);
  for (std::size_t i = 0; i < plain->size(); ++i) {
    EXPECT_LT(((*plain)[i] - (*found)[i]).norm(), 1e-3);
  }
}

TEST(FindBoard, WhatShowsNoWholeBoardIsRefused) {
  const CameraModel camera = BoardCamera();
  const BoardPainter painter(camera);
  Random random("none");
  auto pixels = painter.Paint(kChess, Placed(kChess, camera, {}), 1.0, random);
  const auto other = FindBoard(painter.View(pixels), BoardFrom("chessboard:11x8:25"));
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error(), FindBoardFailure::kNotSeen);
  // A hand before it.
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (i % 640 > 330) pixels[i] = 120;
  }
  EXPECT_FALSE(FindBoard(painter.View(pixels), kChess));
  EXPECT_FALSE(FindBoard(painter.View(pixels), kCircles));
  EXPECT_EQ(FindBoard(ImageView{}, kChess).error(), FindBoardFailure::kNoImage);
}

TEST(CalibrateCamera, ErrorsAreWhatTheCovarianceSays) {
  constexpr int kDraws = 40;
  constexpr double kSigma_px = 0.1;
  double nees = 0.0;
  double residual_px = 0.0;
  Eigen::Matrix<double, 8, 1> squared = Eigen::Matrix<double, 8, 1>::Zero();
  for (std::uint64_t draw = 0; draw < kDraws; ++draw) {
    Random random("nees", draw);
    const auto placements = GoodPlacements(kChess, BoardCamera(), 18, random);
    const auto found =
        Calibrated(kChess, NoisyViews(kChess, BoardCamera(), placements, kSigma_px, random));
    ASSERT_TRUE(found.has_value()) << Advice(found.error()) << " in draw " << draw;
    nees += Nees(*found) / kDraws;
    squared +=
        ErrorOf(found->camera).cwiseAbs2().cwiseQuotient(found->covariance.diagonal().head<8>()) /
        kDraws;
    residual_px += found->residual_px / kDraws;
    EXPECT_EQ(found->covariance(8, 8), 0.0);
    EXPECT_EQ(found->camera.k3, 0.0);
    EXPECT_EQ(found->dof, 18 * (108 - 6) - 8);
  }
  // Mean of 40 draws of eight degrees of freedom: 8 +- 1.24 at 95 %.
  EXPECT_NEAR(nees, 8.0, 1.6);
  EXPECT_NEAR(residual_px, kSigma_px, 0.002);
  for (int i = 0; i < 8; ++i) EXPECT_NEAR(squared(i), 1.0, 0.6) << "parameter " << i;
}

TEST(CalibrateCamera, WithK3AllNineHaveTheirSigma) {
  double nees = 0.0;
  constexpr int kDraws = 15;
  for (std::uint64_t draw = 0; draw < kDraws; ++draw) {
    Random random("k3", draw);
    CameraModel camera = BoardCamera();
    camera.k3 = 0.05;
    const auto placements = GoodPlacements(kChess, camera, 18, random);
    CameraCalibrationOptions options;
    options.with_k3 = true;
    const auto found =
        Calibrated(kChess, NoisyViews(kChess, camera, placements, 0.1, random), options);
    ASSERT_TRUE(found.has_value()) << Advice(found.error());
    const IntrinsicVector error = IntrinsicsOf(found->camera) - IntrinsicsOf(camera);
    nees += error.dot(found->covariance.ldlt().solve(error)) / kDraws;
  }
  EXPECT_NEAR(nees, 9.0, 3.0);
}

TEST(CalibrateCamera, PicturesOfAChessboardGiveTheCameraThatTookThem) {
  const CameraModel camera = BoardCamera();
  const BoardPainter painter(camera);
  Random random("chess pictures");
  Views views;
  for (const Rigid3& placement : GoodPlacements(kChess, camera, 18, random)) {
    const auto pixels = painter.Paint(kChess, placement, 2.0, random);
    const auto found = FindBoard(painter.View(pixels), kChess);
    if (found) views.push_back(*found);
  }
  ASSERT_GE(views.size(), 16u);
  const auto found = Calibrated(kChess, views);
  ASSERT_TRUE(found.has_value()) << Advice(found.error());
  EXPECT_LT(found->residual_px, 0.06);
  const Eigen::Matrix<double, 8, 1> sigma = found->covariance.diagonal().head<8>().cwiseSqrt();
  for (int i = 0; i < 8; ++i) {
    EXPECT_LT(std::abs(ErrorOf(found->camera)(i)), 4.0 * sigma(i)) << "parameter " << i;
  }
  EXPECT_LT(std::abs(found->camera.fx_px / camera.fx_px - 1.0), 1e-3);
}

TEST(CalibrateCamera, PicturesOfCirclesGiveTheCameraThatTookThem) {
  const CameraModel camera = BoardCamera();
  const BoardPainter painter(camera);
  Random random("circle pictures");
  Views views;
  for (const Rigid3& placement : GoodPlacements(kCircles, camera, 18, random)) {
    const auto pixels = painter.Paint(kCircles, placement, 2.0, random);
    const auto found = FindBoard(painter.View(pixels), kCircles);
    if (found) views.push_back(*found);
  }
  ASSERT_GE(views.size(), 16u);
  const auto found = Calibrated(kCircles, views);
  ASSERT_TRUE(found.has_value()) << Advice(found.error());
  EXPECT_LT(found->residual_px, 0.03);
  EXPECT_LT(Nees(*found), 26.1) << "99.9 % of eight";
}

// What the middles of tilted circles are off goes into focal length and distances, and the residual
// does not show it.
TEST(CalibrateCamera, WithoutTheDiameterOfCirclesTheFocalLengthIsOffUnseen) {
  constexpr int kDraws = 8;
  const Board large = BoardFrom("circles:8x6:30:20");
  Board without_diameter = large;
  without_diameter.diameter_m.reset();
  double nees_with = 0.0;
  double nees_without = 0.0;
  for (std::uint64_t draw = 0; draw < kDraws; ++draw) {
    Random random("diameter", draw);
    const auto placements = GoodPlacements(large, BoardCamera(), 18, random);
    const Views views = NoisyViews(large, BoardCamera(), placements, 0.02, random);
    const auto with = Calibrated(large, views);
    const auto without = Calibrated(without_diameter, views);
    ASSERT_TRUE(with && without);
    nees_with += Nees(*with) / kDraws;
    nees_without += Nees(*without) / kDraws;
    EXPECT_LT(without->residual_px, 1.01 * with->residual_px);
  }
  EXPECT_NEAR(nees_with, 8.0, 4.0) << "8 +- 2.8 at 95 %";
  EXPECT_GT(nees_without, 20.0);
}

TEST(CalibrateCamera, TheExpectedMiddleOfACircleIsThatOfItsArea) {
  const CameraModel camera = BoardCamera();
  Random random("discs");
  for (const Rigid3& placement : GoodPlacements(kCircles, camera, 6, random)) {
    const auto points = BoardPoints(kCircles);
    const auto truth = TruePixels(kCircles, camera, placement);
    const auto fit = LinearisedView(kCircles, points, truth, camera, placement);
    ASSERT_TRUE(fit.has_value());
    for (const Eigen::Vector2d& residual : fit->residuals_px) EXPECT_LT(residual.norm(), 1e-3);
    Board middles = kCircles;
    middles.diameter_m.reset();
    const auto coarse = LinearisedView(middles, points, truth, camera, placement);
    EXPECT_GT(std::sqrt(coarse->sum_px2 / 96.0), 0.01);
  }
}

TEST(CalibrateCamera, DerivativesAreThoseOfDifferences) {
  const CameraModel camera = BoardCamera();
  const Rigid3 placement = Placed(kChess, camera, {-1, 1, 0.5, 20.0, -15.0, 10.0, 30.0});
  const auto points = BoardPoints(kChess);
  auto pixels = TruePixels(kChess, camera, placement);
  for (Eigen::Vector2d& pixel : pixels) pixel += Eigen::Vector2d(0.7, -0.4);
  const auto at = LinearisedView(kChess, points, pixels, camera, placement);
  ASSERT_TRUE(at.has_value());
  const auto sum = [&](const IntrinsicVector& step, const PoseError& e) {
    return LinearisedView(kChess, points, pixels, MovedCamera(camera, step), Moved(placement, e))
        ->sum_px2;
  };
  for (int i = 0; i < kIntrinsics; ++i) {
    IntrinsicVector step = IntrinsicVector::Zero();
    step(i) = i < 4 ? 1e-3 : 1e-6;
    const double slope =
        (sum(step, PoseError::Zero()) - sum(-step, PoseError::Zero())) / (2.0 * step(i));
    EXPECT_NEAR(-0.5 * slope, at->pull_camera(i), 1e-4 * std::abs(at->pull_camera(i)) + 1e-4) << i;
  }
  for (int i = 0; i < 6; ++i) {
    PoseError e = PoseError::Zero();
    e(i) = 1e-6;
    const double slope =
        (sum(IntrinsicVector::Zero(), e) - sum(IntrinsicVector::Zero(), -e)) / 2e-6;
    EXPECT_NEAR(-0.5 * slope, at->pull_pose(i), 1e-4 * std::abs(at->pull_pose(i)) + 1e-2) << i;
  }
}

TEST(CalibrateCamera, PartsOfTheImageWithoutPointsAreNamed) {
  Random random("uncovered");
  std::vector<Rigid3> placements;
  for (int i = 0; i < 16; ++i) {
    BoardPlace place;
    place.along_u = i % 2;
    place.along_v = i / 2 % 3 - 1;
    place.share = 0.3;
    place.tilt_u_deg = i % 4 < 2 ? 25.0 : -25.0;
    place.tilt_v_deg = i % 2 == 0 ? 20.0 : -20.0;
    placements.push_back(Placed(kChess, BoardCamera(), place));
  }
  const auto found = Calibrated(kChess, NoisyViews(kChess, BoardCamera(), placements, 0.1, random));
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, CameraCalibrationFault::kUncovered);
  EXPECT_THAT(found.error().coverage.missing,
              ElementsAre(ImagePart::kUpperLeft, ImagePart::kLeft, ImagePart::kLowerLeft));
  EXPECT_THAT(Advice(found.error()),
              HasSubstr("bring the board to the upper left, the left and the lower left"));
  EXPECT_THAT(Advice(found.error()), Not(HasSubstr("tilt")));
  EXPECT_LT(found.error().coverage.share, 0.8);
}

TEST(CalibrateCamera, BoardsParallelToTheImageAreRefused) {
  for (const double sigma_px : {0.02, 0.1}) {
    Random random("flat");
    std::vector<Rigid3> placements;
    for (int i = 0; i < 18; ++i) {
      BoardPlace place;
      place.along_u = i % 3 - 1;
      place.along_v = i / 3 % 3 - 1;
      place.tilt_u_deg = random.Uniform(-2.0, 2.0);
      place.tilt_v_deg = random.Uniform(-2.0, 2.0);
      placements.push_back(Placed(kChess, BoardCamera(), place));
    }
    const auto found =
        Calibrated(kChess, NoisyViews(kChess, BoardCamera(), placements, sigma_px, random));
    ASSERT_FALSE(found);
    EXPECT_EQ(found.error().fault, CameraCalibrationFault::kTooFlat);
    EXPECT_THAT(Advice(found.error()), HasSubstr("tilt it"));
    EXPECT_THAT(Advice(found.error()), HasSubstr("parallel to the image"));
  }
}

TEST(CalibrateCamera, TheEdgeThatNeverCameNearIsNamed) {
  Random random("one axis");
  std::vector<Rigid3> placements;
  for (int i = 0; i < 18; ++i) {
    BoardPlace place;
    place.along_u = i % 3 - 1;
    place.along_v = i / 3 % 3 - 1;
    place.tilt_u_deg = i % 2 == 0 ? 28.0 : -28.0;
    placements.push_back(Placed(kChess, BoardCamera(), place));
  }
  const auto found = Calibrated(kChess, NoisyViews(kChess, BoardCamera(), placements, 0.1, random));
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, CameraCalibrationFault::kTooFlat);
  EXPECT_THAT(Advice(found.error()), HasSubstr("left edge"));
  EXPECT_THAT(Advice(found.error()), Not(HasSubstr("upper edge")));
}

// A good set, the seventh picture of which is spoilt by `spoil`.
template <class Spoil>
Result<CameraCalibration, CameraCalibrationFailure> WithOneBad(const Spoil& spoil) {
  Random random("one bad");
  const auto placements = GoodPlacements(kChess, BoardCamera(), 20, random);
  Views views = NoisyViews(kChess, BoardCamera(), placements, 0.1, random);
  spoil(views[7]);
  return Calibrated(kChess, views);
}

void ExpectSeventhLeftOut(const Result<CameraCalibration, CameraCalibrationFailure>& found) {
  ASSERT_TRUE(found.has_value()) << Advice(found.error());
  for (std::size_t i = 0; i < found->pictures.size(); ++i) {
    EXPECT_EQ(found->pictures[i].used, i != 7) << i;
  }
  EXPECT_NEAR(found->residual_px, 0.1, 0.01);
  EXPECT_LT(Nees(*found), 26.1) << "99.9 % of eight";
}

TEST(CalibrateCamera, OnePictureWithPointsInTheWrongOrderIsLeftOut) {
  const auto found = WithOneBad([](std::vector<Eigen::Vector2d>& pixels) {
    std::rotate(pixels.begin(), pixels.begin() + 4, pixels.end());
  });
  ExpectSeventhLeftOut(found);
}

TEST(CalibrateCamera, OnePictureOfABentBoardIsLeftOut) {
  const auto found = WithOneBad([](std::vector<Eigen::Vector2d>& pixels) {
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const double along = static_cast<double>(i % 9) / 4.0 - 1.0;
      pixels[i].y() += 1.5 * along * along;
    }
  });
  ExpectSeventhLeftOut(found);
  EXPECT_TRUE(found->pictures[7].is_placed);
  EXPECT_GT(found->pictures[7].rms_px, 0.25);
}

TEST(CalibrateCamera, ManyThatDoNotFitAreNoCalibration) {
  Random random("many bad");
  const auto placements = GoodPlacements(kChess, BoardCamera(), 18, random);
  Views views = NoisyViews(kChess, BoardCamera(), placements, 0.1, random);
  for (std::size_t i = 0; i < 8; ++i) {
    std::rotate(views[2 * i].begin(), views[2 * i].begin() + 4, views[2 * i].end());
  }
  const auto found = Calibrated(kChess, views);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, CameraCalibrationFault::kDisagree);
  EXPECT_THAT(found.error().left_out, Contains(4u));
  EXPECT_EQ(found.error().left_out.size(), 8u);

  views = NoisyViews(kChess, BoardCamera(), placements, 4.0, random);
  const auto coarse = Calibrated(kChess, views);
  ASSERT_FALSE(coarse);
  EXPECT_EQ(coarse.error().fault, CameraCalibrationFault::kTooCoarse);
  EXPECT_NEAR(coarse.error().residual_px, 4.0, 0.4);
}

TEST(CalibrateCamera, AFewPicturesOrOneTakenAgainAndAgainAreRefused) {
  Random random("few");
  const auto placements = GoodPlacements(kChess, BoardCamera(), 4, random);
  const auto few = Calibrated(kChess, NoisyViews(kChess, BoardCamera(), placements, 0.1, random));
  ASSERT_FALSE(few);
  EXPECT_EQ(few.error().fault, CameraCalibrationFault::kTooFew);
  EXPECT_THAT(Advice(few.error()), HasSubstr("five"));
  const auto none = Calibrated(kChess, {});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().coverage.missing.size(), 9u);

  const std::vector<Rigid3> same(12, Placed(kChess, BoardCamera(), {}));
  const auto again = Calibrated(kChess, NoisyViews(kChess, BoardCamera(), same, 0.05, random));
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().fault, CameraCalibrationFault::kUncovered);
  EXPECT_THAT(Advice(again.error()), HasSubstr("lower right"));
}

TEST(PlaceBoard, ErrorsAreWhatTheCovarianceSays) {
  constexpr int kDraws = 300;
  constexpr double kSigma_px = 0.2;
  double nees = 0.0;
  double chi2 = 0.0;
  double dof = 0.0;
  Random random("place");
  for (int draw = 0; draw < kDraws; ++draw) {
    BoardPlace place;
    place.share = 0.45;
    place.tilt_u_deg = random.Uniform(15.0, 35.0);
    place.tilt_v_deg = random.Uniform(-35.0, 35.0);
    place.roll_deg = random.Uniform(-180.0, 180.0);
    const Rigid3 truth = Placed(kAsymmetric, BoardCamera(), place);
    const Views views = NoisyViews(kAsymmetric, BoardCamera(), {truth}, kSigma_px, random);
    const auto found = PlaceBoard(kAsymmetric, views[0], BoardCamera());
    ASSERT_TRUE(found.has_value()) << draw;
    const PoseError error = ErrorBetween(found->camera_from_board, truth);
    nees += error.dot(found->cofactor.ldlt().solve(error)) / (kSigma_px * kSigma_px) / kDraws;
    chi2 += found->sum_px2 / (kSigma_px * kSigma_px);
    dof += found->dof;
  }
  EXPECT_NEAR(nees, 6.0, 0.6) << "6 +- 0.39 at 95 %";
  EXPECT_NEAR(chi2 / dof, 1.0, 0.03);
}

TEST(PlaceBoard, AFarFrontalBoardHasTwoPlacements) {
  Random random("two");
  CameraModel camera = BoardCamera();
  BoardPlace place;
  place.share = 0.08;
  place.tilt_u_deg = 8.0;
  const Rigid3 truth = Placed(kChess, camera, place);
  const Views views = NoisyViews(kChess, camera, {truth}, 0.3, random);
  const auto found = PlaceBoard(kChess, views[0], camera);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error(), BoardPoseFailure::kTwoPoses);
}

TEST(PlaceBoard, PointsBeyondTheLensAreRefused) {
  CameraModel camera = BoardCamera();
  camera.k1 = -1.6;
  camera.k2 = 0.0;
  const Views views = {TruePixels(kChess, BoardCamera(), Placed(kChess, BoardCamera(), {-1, -1}))};
  const auto found = PlaceBoard(kChess, views[0], camera);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error(), BoardPoseFailure::kBeyondLens);
  EXPECT_EQ(PlaceBoard(kChess, {}, BoardCamera()).error(), BoardPoseFailure::kNoPose);
}

}  // namespace
}  // namespace tbm
