// The design axis against what one writes without it. Evaluation: the natural equation integrated
// anew for each place, by Gauss-Legendre from the start of the element, as exact as ours. Foot of a
// point: the nearest vertex of a polyline every 10 cm, all vertices looked at, and the nearer of
// the two chords there, which is 4 um off in this curve. The same draws for both, turn by turn;
// medians.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <limits>
#include <vector>

#include "guidance/axis/design_axis.h"
#include "tests/guidance/axis/made_axis.h"
#include "tests/support/random.h"

namespace {

using tbm::DesignAxis;
using tbm::InternalChainage;
using tbm::test::MadeAxis;
using tbm::test::Part;

constexpr int kDraws = 20'000;
constexpr int kRivalDraws = 400;  // the slow one sees the first of them
constexpr int kRounds = 15;

double sink = 0.0;  // keeps results from being optimised away

template <class Work>
double SecondsEach(int count, Work work) {
  const std::clock_t start = std::clock();
  for (int i = 0; i < count; ++i) sink += work(static_cast<std::size_t>(i));
  return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC / count;
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + kRounds / 2, values.end());
  return values[kRounds / 2];
}

// Ten times the drive of the tests, one behind the other: 7 km.
MadeAxis LongDrive() {
  const MadeAxis drive = tbm::test::MakeDrive({{0.0, 0.0}, 0.0});
  std::vector<Part> parts;
  for (int i = 0; i < 10; ++i) parts.insert(parts.end(), drive.parts.begin(), drive.parts.end());
  MadeAxis made = tbm::test::Make(parts, {{1000.0, 2000.0}, 0.5}, 0.0);
  for (int i = 0; i <= 10; ++i) {
    tbm::ProfileElement point;
    point.at = {700.0 * i};
    point.up_m = 400.0 + (i % 2) * 7.0;
    if (i > 0 && i < 10) {
      point.kind = tbm::ProfileKind::kParabola;
      point.length_in_m = 100.0;
    }
    made.description.profile.push_back(point);
  }
  return made;
}

// Direct quadrature from the start of the element.
struct Rival {
  struct Element {
    Part part;
    double start_m;
    Eigen::Vector2d place;
    double heading_rad;
  };
  std::vector<Element> elements;

  explicit Rival(const MadeAxis& made) {
    std::vector<double> starts_m = {0.0};
    for (const Part& part : made.parts) starts_m.push_back(starts_m.back() + part.length_m);
    const auto states = made.States(starts_m);
    for (std::size_t i = 0; i < made.parts.size(); ++i) {
      elements.push_back(
          {made.parts[i], starts_m[i], made.Place(states[i]), made.Heading(states[i])});
    }
  }
  static double Heading(const Element& element, double s_m) {
    const Part& part = element.part;
    const double u = s_m / part.length_m;
    const double share = part.kind == Part::kBloss ? u * u * u * (1.0 - 0.5 * u) : 0.5 * u * u;
    return element.heading_rad + part.first_per_m * s_m +
           (part.last_per_m - part.first_per_m) * part.length_m * share;
  }
  Eigen::Vector2d At(double chainage_m) const {
    const auto next = std::upper_bound(
        elements.begin(), elements.end(), chainage_m, [](double at_m, const Element& element) {
          return at_m < element.start_m;
        });
    const Element& element = *std::prev(next);
    const double s_m = chainage_m - element.start_m;
    constexpr int kPieces = 4;
    constexpr double kPlace[] = {
        -0.9061798459386640, -0.5384693101056831, 0.0, 0.5384693101056831, 0.9061798459386640};
    constexpr double kWeight[] = {0.2369268850561891,
                                  0.4786286704993665,
                                  0.5688888888888889,
                                  0.4786286704993665,
                                  0.2369268850561891};
    Eigen::Vector2d place = element.place;
    const double half_m = s_m / kPieces / 2.0;
    for (int piece = 0; piece < kPieces; ++piece) {
      for (int i = 0; i < 5; ++i) {
        const double heading = Heading(element, (2 * piece + 1 + kPlace[i]) * half_m);
        place += kWeight[i] * half_m * Eigen::Vector2d(std::cos(heading), std::sin(heading));
      }
    }
    return place;
  }
};

struct Polyline {
  std::vector<Eigen::Vector2d> vertices;

  double Right(const Eigen::Vector2d& p) const {
    std::size_t nearest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      const double squared = (vertices[i] - p).squaredNorm();
      if (squared < least) {
        least = squared;
        nearest = i;
      }
    }
    double right_m = std::sqrt(least);
    for (std::size_t i = nearest > 0 ? nearest - 1 : 0;
         i < std::min(nearest + 1, vertices.size() - 1);
         ++i) {
      const Eigen::Vector2d along = (vertices[i + 1] - vertices[i]).normalized();
      const Eigen::Vector2d from = p - vertices[i];
      const double off_m = along.y() * from.x() - along.x() * from.y();
      if (std::abs(off_m) < std::abs(right_m)) right_m = off_m;
    }
    return right_m;
  }
};

}  // namespace

int main() {
  const MadeAxis made = LongDrive();
  const auto built = DesignAxis::Build(made.description);
  if (!built) return 1;
  const DesignAxis& axis = *built;
  const Rival rival(made);
  Polyline polyline;
  for (double at_m = 0.0; at_m < 7000.0; at_m += 0.1) {
    polyline.vertices.push_back(axis.At({at_m})->p_plan_in_site);
  }
  tbm::test::Random random("axis bench");
  std::vector<double> chainages_m;
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < kDraws; ++i) {
    chainages_m.push_back(random.Uniform(1.0, 6999.0));
    const auto point = axis.At({chainages_m.back()});
    points.push_back(*point->p_in_site() + random.Normal3(0.3));
  }
  double worst_m = 0.0;
  for (const double at_m : chainages_m) {
    worst_m = std::max(worst_m, (axis.At({at_m})->p_plan_in_site - rival.At(at_m)).norm());
  }
  std::vector<double> at;
  std::vector<double> quadrature;
  std::vector<double> project;
  std::vector<double> hinted;
  std::vector<double> vertices;
  for (int round = 0; round < kRounds; ++round) {
    at.push_back(
        SecondsEach(kDraws, [&](std::size_t i) { return *axis.At({chainages_m[i]})->up_m; }));
    quadrature.push_back(
        SecondsEach(kDraws, [&](std::size_t i) { return rival.At(chainages_m[i]).x(); }));
    project.push_back(SecondsEach(
        kDraws, [&](std::size_t i) { return axis.Project(points[i])->deviation_right_m; }));
    hinted.push_back(SecondsEach(kDraws, [&](std::size_t i) {
      return axis.Project(points[i], InternalChainage{chainages_m[i] + 2.0})->deviation_right_m;
    }));
    vertices.push_back(SecondsEach(kRivalDraws, [&](std::size_t i) {
      return polyline.Right({points[i].x(), points[i].y()});
    }));
  }
  std::printf("7 km, %zu pieces; evaluation and quadrature differ by %.1e m at most\n",
              axis.plan().piece_count(),
              worst_m);
  std::printf("evaluation   %7.0f ns, %5.2f million/s   quadrature     %9.0f ns\n",
              1e9 * Median(at),
              1e-6 / Median(at),
              1e9 * Median(quadrature));
  std::printf("projection   %7.0f ns, %5.2f million/s   nearest vertex %9.0f ns\n",
              1e9 * Median(project),
              1e-6 / Median(project),
              1e9 * Median(vertices));
  std::printf(
      "with a hint  %7.0f ns, %5.2f million/s\n", 1e9 * Median(hinted), 1e-6 / Median(hinted));
  std::printf("bench axis_at: %.1fx faster than direct quadrature, %.2f million/s (wanted 1)\n",
              Median(quadrature) / Median(at),
              1e-6 / Median(at));
  std::printf(
      "bench axis_project: %.1fx faster than the nearest of 70 000 vertices, %.2f million/s "
      "(wanted 0.3)\n",
      Median(vertices) / Median(project),
      1e-6 / Median(project));
  return sink == 0.12345 ? 1 : 0;
}
