#pragma once

#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "devices/total_station/emulated_instrument.h"
#include "guidance/station/station_keeper.h"
#include "tests/support/random.h"

namespace tbm::test {

inline constexpr double kArcsec = std::numbers::pi / 180.0 / 3600.0;

// A tunnel to the north with a station on a bracket, references behind and before it, and a rear
// shield ahead; a keeper that measures them by an instrument's optics, without line or protocol.
class StationScene {
 public:
  struct Told {
    Judged judged;
    Timestamp at;
    Eigen::Vector3d off_m;  // of a prism: from where the one of that name belongs on the shield
  };

  explicit StationScene(std::string_view stream, std::uint64_t case_number = 0)
      : random_(stream, case_number) {
    instrument.pillar.p_in_site = {1000.0, 2000.0, 50.0};
    instrument.pillar.circle_zero_bearing_rad = 0.25;
    instrument.pillar.since = now;
    instrument.errors.seed = 1 + random_.Bits() % 1'000'000;
    instrument.errors.angle_sigma_rad = 1.0 * kArcsec;
    instrument.errors.slope_sigma_m = 0.6e-3;
    instrument.errors.collimation_rad = 8.0 * kArcsec;
    instrument.errors.index_rad = -5.0 * kArcsec;
    references = {{997.0, 1960.0, 51.5},
                  {1003.0, 1975.0, 50.5},
                  {997.5, 1985.0, 52.5},
                  {1003.0, 2030.0, 51.0},
                  {997.2, 2022.0, 52.2}};
    shield.translation = {1000.0, 2045.0, 50.0};
    shield.rotation = Eigen::AngleAxisd(0.5 * std::numbers::pi - 0.02, Eigen::Vector3d::UnitZ()) *
                      Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitX());

    options.start = {{1000.1, 1999.9, 50.1}, 0.252};
    options.shield_start = Rigid3{
        Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * std::numbers::pi, Eigen::Vector3d::UnitZ())),
        {1000.1, 2045.2, 50.1}};
    options.angle_sigma_rad = 1.0 * kArcsec;
    options.slope_sigma_m = 0.6e-3;
    options.slope_sigma_ppm = 0.0;
    options.set_up.refraction_k_sigma = 1e-3;
    options.prisms = {{"left", {-4.0, 1.9, 1.5}, 3e-4},
                      {"right", {-4.0, -1.9, 1.5}, 3e-4},
                      {"top", {-1.0, 0.0, 2.9}, 3e-4}};
    taken_for_it = {0, 1, 2};
  }

  // The keeper's options name references with survey errors of 0.5 mm.
  void Start() {
    for (std::size_t i = 0; i < references.size(); ++i) {
      const double sigma_m = 0.5e-3;
      options.references.push_back({"R" + std::to_string(i + 1),
                                    {references[i] + random_.Normal3(sigma_m), sigma_m},
                                    i == control_reference});
    }
    ListPrisms();
    keeper.emplace(options);
    keeper->SetInstrument(77);
  }
  void Restart() {
    const KeptStation kept = keeper->state();
    keeper.emplace(options);
    keeper->Restore(kept);
    keeper->SetInstrument(77);
  }

  // Lets the keeper work for so long; idle time passes as it asks.
  void Run(Duration span) {
    const Timestamp until = now + span;
    while (now < until) {
      Advance();
      const auto pointing = keeper->Next(now);
      for (KeeperNews& item : keeper->TakeNews()) news.push_back(std::move(item));
      if (!pointing) {
        now = std::max(now + std::chrono::milliseconds(50), keeper->wait_until());
        continue;
      }
      const Pointed pointed = Carry(*pointing);
      Told one{keeper->Take(pointed), pointed.at, Eigen::Vector3d::Zero()};
      if (one.judged.target.kind == TargetKind::kPrism && one.judged.p_in_site) {
        one.off_m = *one.judged.p_in_site - Place(one.judged.target.index);
      }
      told.push_back(one);
    }
  }
  // Until the keeper is where it should be, at most so long.
  bool RunUntil(const std::function<bool()>& is_there, Duration at_most) {
    for (const Timestamp until = now + at_most; now < until;) {
      if (is_there()) return true;
      Run(std::chrono::seconds(1));
    }
    return is_there();
  }

  // Where prism `index` belongs on the true shield now.
  Eigen::Vector3d Place(int index) const {
    return shield * options.prisms[static_cast<std::size_t>(index)].p_in_rear_shield;
  }
  ShieldBelief Belief() const {
    ShieldBelief belief{now, shield, PoseCovariance::Identity() * 1e-10, speed_m_per_s, 1e-5};
    belief.covariance.bottomRightCorner<3, 3>() = 1e-6 * Eigen::Matrix3d::Identity();
    return belief;
  }

  // Of the prisms' positions that were called good, the one that is furthest from the truth.
  double WorstGood_m(Timestamp until = {INT64_MAX}) const {
    double worst_m = 0.0;
    for (const Told& one : told) {
      const bool counts = one.judged.target.kind == TargetKind::kPrism &&
                          one.judged.trust == Trust::kGood && one.at <= until;
      if (counts) worst_m = std::max(worst_m, one.off_m.norm());
    }
    return worst_m;
  }
  int Count(Trust trust, std::string_view reason, int prism = -1, Timestamp since = {}) const {
    int count = 0;
    for (const Told& one : told) {
      count += one.judged.target.kind == TargetKind::kPrism && one.judged.trust == trust &&
               one.judged.reason == reason && (prism < 0 || one.judged.target.index == prism) &&
               one.at > since;
    }
    return count;
  }
  bool HasNews(KeeperNews::Kind kind) const {
    return std::ranges::any_of(news, [&](const auto& item) { return item.kind == kind; });
  }
  std::string AllNews() const {
    std::string all;
    for (const auto& item : news) all += item.text + "\n";
    return all;
  }

  EmulatedInstrument instrument;
  Timestamp now{1'790'000'000'000'000'000};
  std::vector<Eigen::Vector3d> references;  // where they truly stand
  std::size_t control_reference = 99;
  Rigid3 shield;  // true site_from_rear_shield
  double speed_m_per_s = 0.0;
  bool believes = false;
  std::vector<int> taken_for_it;  // whoever aims at prism i gets prism taken_for_it[i]
  std::vector<bool> is_hidden = std::vector<bool>(16);  // references, then prisms
  std::optional<Eigen::Vector3d> vest;
  Duration pointing_takes = std::chrono::seconds(3);
  KeeperOptions options;
  std::optional<StationKeeper> keeper;
  std::vector<Told> told;
  std::vector<KeeperNews> news;

 private:
  void ListPrisms() {
    instrument.prisms.clear();
    const auto add = [this](std::string name, std::function<std::optional<Eigen::Vector3d>()> at) {
      instrument.prisms.push_back({std::move(name), [at](Timestamp) { return at(); }, 0.0});
    };
    for (std::size_t i = 0; i < references.size(); ++i) {
      add("R", [this, i]() -> std::optional<Eigen::Vector3d> {
        if (is_hidden[i]) return {};
        return references[i];
      });
    }
    for (std::size_t i = 0; i < options.prisms.size(); ++i) {
      add("P", [this, i]() -> std::optional<Eigen::Vector3d> {
        if (is_hidden[references.size() + i]) return {};
        return Place(static_cast<int>(i));
      });
    }
    add("vest", [this] { return vest; });
  }
  void Advance() {
    const double passed_s = SecondsBetween(moved_at_, now);
    if (moved_at_.ns != 0) {
      shield.translation += shield.rotation * Eigen::Vector3d(passed_s * speed_m_per_s, 0.0, 0.0);
    }
    moved_at_ = now;
    if (believes) keeper->Believe(Belief());
  }
  Pointed Carry(const Pointing& pointing) {
    now = now + pointing_takes;
    Advance();
    Pointed pointed;
    pointed.at = now;
    pointed.within_s = 0.5;
    constexpr double kPi = std::numbers::pi;
    instrument.PointTo(
        pointing.face == Face::kOne
            ? CircleReading{Turn(pointing.circle_rad), pointing.zenith_rad}
            : CircleReading{Turn(pointing.circle_rad + kPi), 2.0 * kPi - pointing.zenith_rad});
    if (pointing.target.kind == TargetKind::kPrism) {
      const auto taken = taken_for_it[static_cast<std::size_t>(pointing.target.index)];
      if (taken != pointing.target.index) {
        instrument.PointTo(instrument.IdealReading(Place(taken), now, pointing.face));
      }
    }
    constexpr double kField = 2.0 * EmulatedInstrument::kRecognitionRad;
    int code = instrument.FindPrism(kField, kField, now);
    if (code == 8710 && pointing.is_rough) {
      code = instrument.FindPrism(options.window.horizontal_rad, options.window.vertical_rad, now);
    }
    if (code != 0) {
      pointed.failure = code == 8711 ? "several_targets" : "no_target";
      return pointed;
    }
    pointed.raw.slope_m = instrument.ReadSlope(now);
    const CircleReading circles = instrument.ReadCircles(now);
    pointed.raw.circle_rad = circles.horizontal_rad;
    pointed.raw.zenith_rad = circles.zenith_rad;
    pointed.raw.face = FaceOf(circles);
    return pointed;
  }

  Random random_;
  Timestamp moved_at_;
};

}  // namespace tbm::test
