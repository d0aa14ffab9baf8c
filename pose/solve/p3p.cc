#include "pose/solve/p3p.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "pose/solve/cubic.h"

namespace tbm {
namespace {

using Conic = Eigen::Matrix3d;  // symmetric form over the three depths

Eigen::Matrix3d Adjugate(const Conic& m) {
  Eigen::Matrix3d adjugate;  // of a symmetric matrix: its cofactors
  adjugate.row(0) = m.row(1).cross(m.row(2));
  adjugate.row(1) = m.row(2).cross(m.row(0));
  adjugate.row(2) = m.row(0).cross(m.row(1));
  return adjugate;
}

double Dot(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) { return a.cwiseProduct(b).sum(); }

// The member of the pencil first + x * second that is a pair of real lines, the clearest one.
// False when none is real: the two conics have no real point in common.
bool LinePair(const Conic& first, const Conic& second, Conic& pair) {
  const Eigen::Matrix3d adj_first = Adjugate(first);
  const Eigen::Matrix3d adj_second = Adjugate(second);
  double c0 = Dot(first, adj_first) / 3.0;  // determinant
  double c1 = Dot(second, adj_first);
  double c2 = Dot(first, adj_second);
  double c3 = Dot(second, adj_second) / 3.0;
  const bool swapped = std::abs(c3) < std::abs(c0);
  if (swapped) {
    std::swap(c0, c3);
    std::swap(c1, c2);
  }
  if (c3 == 0.0) return false;
  double clearest = 0.0;
  for (const double root : CubicRoots(c3, c2, c1, c0)) {
    Conic member = swapped ? Conic(root * first + second) : Conic(first + root * second);
    member /= member.norm();
    // Real lines: the sum of the principal minors, product of the two eigenvalues, is negative.
    const double minors = Adjugate(member).trace();
    if (minors < clearest) {
      clearest = minors;
      pair = member;
    }
  }
  return clearest < 0.0;
}

// l m^T + m l^T = pair, for a pair of real lines: pair plus the skew matrix of their crossing point
// has rank one.
void SplitLines(const Conic& pair, Eigen::Vector3d& l, Eigen::Vector3d& m) {
  const Eigen::Matrix3d crossing = -Adjugate(pair);
  Eigen::Index column = 0;
  crossing.diagonal().maxCoeff(&column);
  const Eigen::Vector3d point = crossing.col(column) / std::sqrt(crossing(column, column));
  const Eigen::Matrix3d product = pair + Skew(point);
  Eigen::Index best_row = 0;
  Eigen::Index best_column = 0;
  product.cwiseAbs().maxCoeff(&best_row, &best_column);
  l = product.row(best_row).transpose();
  m = product.col(best_column);
}

struct Triangle {
  Eigen::Vector3d b0, b1, b2;  // unit bearings
  double cos01, cos02, cos12;
  double d01, d02, d12;  // squared sides [m^2]

  Eigen::Vector3d Mismatch(const Eigen::Vector3d& s) const {
    return {s[0] * s[0] + s[1] * s[1] - 2.0 * cos01 * s[0] * s[1] - d01,
            s[0] * s[0] + s[2] * s[2] - 2.0 * cos02 * s[0] * s[2] - d02,
            s[1] * s[1] + s[2] * s[2] - 2.0 * cos12 * s[1] * s[2] - d12};
  }
  Eigen::Matrix3d ByDepth(const Eigen::Vector3d& s) const {
    Eigen::Matrix3d derivative;
    derivative << s[0] - cos01 * s[1], s[1] - cos01 * s[0], 0.0, s[0] - cos02 * s[2], 0.0,
        s[2] - cos02 * s[0], 0.0, s[1] - cos12 * s[2], s[2] - cos12 * s[1];
    return 2.0 * derivative;
  }
};

// Newton on the three cosine laws; keeps a step only when it lowers the mismatch.
void Polish(const Triangle& triangle, Eigen::Vector3d& depths) {
  Eigen::Vector3d mismatch = triangle.Mismatch(depths);
  for (int i = 0; i < 4; ++i) {
    const Eigen::Matrix3d by_depth = triangle.ByDepth(depths);
    const Eigen::Vector3d next = depths - by_depth.inverse() * mismatch;
    const Eigen::Vector3d next_mismatch = triangle.Mismatch(next);
    if (!(next_mismatch.squaredNorm() < mismatch.squaredNorm())) return;
    depths = next;
    mismatch = next_mismatch;
  }
}

// Points common to the line and the conic `through`, as depth ratios.
FixedVector<Eigen::Vector3d, 2> OnLine(const Eigen::Vector3d& line, const Conic& through) {
  FixedVector<Eigen::Vector3d, 2> points;
  Eigen::Index smallest = 0;
  line.cwiseAbs().minCoeff(&smallest);
  const Eigen::Vector3d u = line.cross(Eigen::Vector3d::Unit(smallest)).normalized();
  const Eigen::Vector3d v = line.cross(u).normalized();
  const double a = u.dot(through * u);
  const double b = u.dot(through * v);
  const double c = v.dot(through * v);
  // a p^2 + 2 b p q + c q^2 = 0. A discriminant just below zero is two merging roots.
  double discriminant = b * b - a * c;
  if (discriminant < -1e-9 * (b * b + std::abs(a * c))) return points;
  discriminant = std::max(discriminant, 0.0);
  const double k = -(b + std::copysign(std::sqrt(discriminant), b));
  if (k == 0.0 && a == 0.0 && c == 0.0) return points;
  points.push_back(k * u + a * v);
  points.push_back(c * u + k * v);
  return points;
}

Eigen::Matrix3d TriadOf(const Eigen::Vector3d& p0,
                        const Eigen::Vector3d& p1,
                        const Eigen::Vector3d& p2) {
  Eigen::Matrix3d triad;
  triad.col(0) = (p1 - p0).normalized();
  triad.col(2) = (p1 - p0).cross(p2 - p0).normalized();
  triad.col(1) = triad.col(2).cross(triad.col(0));
  return triad;
}

}  // namespace

P3pPoses SolveP3p(const std::array<Eigen::Vector3d, 3>& bearings,
                  const std::array<Eigen::Vector3d, 3>& points) {
  P3pPoses poses;
  const Eigen::Vector3d side01 = points[1] - points[0];
  const Eigen::Vector3d side02 = points[2] - points[0];
  const double lengths = side01.norm() * side02.norm();
  if (!(side01.cross(side02).norm() > 1e-9 * lengths)) return poses;

  Triangle triangle;
  triangle.b0 = bearings[0].normalized();
  triangle.b1 = bearings[1].normalized();
  triangle.b2 = bearings[2].normalized();
  triangle.cos01 = triangle.b0.dot(triangle.b1);
  triangle.cos02 = triangle.b0.dot(triangle.b2);
  triangle.cos12 = triangle.b1.dot(triangle.b2);
  triangle.d01 = side01.squaredNorm();
  triangle.d02 = side02.squaredNorm();
  triangle.d12 = (points[2] - points[1]).squaredNorm();

  Conic m01;
  Conic m02;
  Conic m12;
  m01 << 1.0, -triangle.cos01, 0.0, -triangle.cos01, 1.0, 0.0, 0.0, 0.0, 0.0;
  m02 << 1.0, 0.0, -triangle.cos02, 0.0, 0.0, 0.0, -triangle.cos02, 0.0, 1.0;
  m12 << 0.0, 0.0, 0.0, 0.0, 1.0, -triangle.cos12, 0.0, -triangle.cos12, 1.0;
  const double sum = triangle.d01 + triangle.d02 + triangle.d12;
  const Conic first = (triangle.d12 * m01 - triangle.d01 * m12) / sum;
  const Conic second = (triangle.d12 * m02 - triangle.d02 * m12) / sum;
  Conic pair;
  if (!LinePair(first, second, pair)) return poses;
  std::array<Eigen::Vector3d, 2> lines;
  SplitLines(pair, lines[0], lines[1]);

  // The conic that is least like the pair itself cuts its lines the cleanest.
  const double first_likeness = std::abs(Dot(first, pair)) * second.norm();
  const double second_likeness = std::abs(Dot(second, pair)) * first.norm();
  const Conic& through = first_likeness < second_likeness ? first : second;
  const Eigen::Matrix3d points_triad = TriadOf(points[0], points[1], points[2]);
  for (const Eigen::Vector3d& line : lines) {
    for (Eigen::Vector3d depths : OnLine(line, through)) {
      const double scale_squared = depths.dot((m01 + m02 + m12) * depths);
      if (!(scale_squared > 0.0)) continue;
      depths *= std::sqrt(sum / scale_squared) * (depths.sum() < 0.0 ? -1.0 : 1.0);
      if (!(depths.minCoeff() > 0.0)) continue;
      Polish(triangle, depths);
      if (!(depths.minCoeff() > 0.0)) continue;
      const Eigen::Vector3d p0 = depths[0] * triangle.b0;
      const Eigen::Matrix3d seen_triad =
          TriadOf(p0, depths[1] * triangle.b1, depths[2] * triangle.b2);
      const Eigen::Matrix3d rotation = seen_triad * points_triad.transpose();
      poses.push_back({Eigen::Quaterniond(rotation).normalized(), p0 - rotation * points[0]});
    }
  }
  return poses;
}

}  // namespace tbm
