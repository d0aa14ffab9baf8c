// The program itself, as a shell sees it.
#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include <Eigen/Core>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include "pose/rig/rig_file.h"
#include "tests/support/calibration_data.h"
#include "tests/support/command.h"
#include "tests/support/scene.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;
using test::ReadText;
using test::Rows;
using test::TempFolder;
using test::WriteText;
using ::testing::HasSubstr;
using ::testing::Not;

const std::string kRun = TBM_SOURCE_DIR "/tests/data/run_small";
constexpr const char* kPoseHeader =
    "stamp_ns,status,reason,leds_used,qw,qx,qy,qz,tx_mm,ty_mm,tz_mm,sigma_rot_x_deg,sigma_rot_y_"
    "deg,"
    "sigma_rot_z_deg,sigma_tx_mm,sigma_ty_mm,sigma_tz_mm,rms_px,shield_head_x_mm,shield_head_y_mm,"
    "shield_head_z_mm,shield_head_sigma_mm,shield_head_bound_mm";

class Tbm : public ::testing::Test {
 protected:
  int Run(const std::string& arguments) {
    const std::string command = "'" TBM_PROGRAM "' " + arguments + " >'" + (folder_ / "stdout") +
                                "' 2>'" + (folder_ / "stderr") + "'";
    const int status = std::system(command.c_str());
    out_ = ReadText(folder_ / "stdout");
    err_ = ReadText(folder_ / "stderr");
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string Path(std::string_view name) const { return folder_ / name; }

  // A copy of the small run that a test may spoil.
  std::string CopiedRun() {
    fs::copy(kRun, Path("run"), fs::copy_options::recursive);
    return Path("run");
  }

  TempFolder folder_;
  std::string out_;
  std::string err_;
};

TEST_F(Tbm, SolveWritesOneRowPerFrameWithExactlyThePromisedColumns) {
  ASSERT_EQ(Run("solve " + kRun + " --out " + Path("p.csv")), 0) << err_;
  const std::string csv = ReadText(Path("p.csv"));
  EXPECT_EQ(csv.substr(0, csv.find('\n')), kPoseHeader);
  const auto rows = Rows(csv);
  const auto truth = Rows(ReadText(kRun + "/truth.csv"));
  ASSERT_EQ(rows.size(), truth.size());
  for (std::size_t i = 1; i < rows.size(); ++i) {
    SCOPED_TRACE(i);
    const std::string& note = truth[i].back();
    ASSERT_EQ(rows[i].size(), 23u);
    EXPECT_EQ(rows[i][0], truth[i][0]);
    if (note == "missing_file") {
      EXPECT_EQ(rows[i][1], "none");
      EXPECT_EQ(rows[i][2], "frame_missing");
      for (std::size_t column = 3; column < 23; ++column) EXPECT_EQ(rows[i][column], "");
      continue;
    }
    EXPECT_EQ(rows[i][1], note == "ok" ? "ok" : "degraded");
    EXPECT_EQ(rows[i][2], note == "ok" ? "" : "few_leds");
    EXPECT_EQ(rows[i][3], note == "ok" ? "5" : "4");
    const auto number = [](const std::string& text) { return std::stod(text); };
    const Eigen::Vector3d head(number(rows[i][18]), number(rows[i][19]), number(rows[i][20]));
    const Eigen::Vector3d true_head(number(truth[i][8]), number(truth[i][9]), number(truth[i][10]));
    const double sigma_mm = number(rows[i][21]);
    EXPECT_LT((head - true_head).norm(), number(rows[i][22])) << "inside its bound";
    EXPECT_LT((head - true_head).norm(), 4.0 * sigma_mm);
    EXPECT_LT(sigma_mm, 3.0);
  }
}

TEST_F(Tbm, SolveGivesTheSameBytesWithAnyNumberOfThreads) {
  ASSERT_EQ(Run("solve " + kRun + " --out " + Path("a.csv") + " --threads 1"), 0);
  ASSERT_EQ(Run("solve " + kRun + " --out " + Path("b.csv") + " --threads 7"), 0);
  EXPECT_EQ(ReadText(Path("a.csv")), ReadText(Path("b.csv")));
}

TEST_F(Tbm, JsonHoldsTheSameValuesAsCsv) {
  ASSERT_EQ(Run("solve " + kRun + " --out " + Path("p.csv")), 0);
  ASSERT_EQ(Run("solve " + kRun + " --out - --format json"), 0);
  const auto rows = Rows(ReadText(Path("p.csv")));
  const auto json = nlohmann::json::parse(out_);
  ASSERT_EQ(json.size(), rows.size() - 1);
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const auto& object = json[i - 1];
    ASSERT_EQ(object.size(), rows[0].size());
    EXPECT_EQ(std::to_string(object["stamp_ns"].get<std::int64_t>()), rows[i][0]);
    EXPECT_EQ(object["reason"], rows[i][2]);
    if (rows[i][8].empty()) {
      EXPECT_TRUE(object["tx_mm"].is_null());
    } else {
      EXPECT_EQ(object["tx_mm"].get<double>(), std::stod(rows[i][8]));
    }
  }
}

TEST_F(Tbm, EveryMethodSolvesTheRun) {
  for (const std::string method : {"fused", "published", "vision"}) {
    ASSERT_EQ(Run("solve " + kRun + " --out " + Path(method) + " --method " + method), 0) << err_;
    const std::string csv = ReadText(Path(method));
    EXPECT_THAT(csv, HasSubstr(",ok,,5,")) << method;
    EXPECT_THAT(csv, Not(HasSubstr("nan"))) << method;
  }
  EXPECT_NE(ReadText(Path("fused")), ReadText(Path("vision")));
  EXPECT_NE(ReadText(Path("fused")), ReadText(Path("published")));
}

TEST_F(Tbm, CentresWritesOneRowPerSpotWithItsLed) {
  ASSERT_EQ(Run("centres " + kRun + " --out " + Path("c.csv")), 0) << err_;
  const auto rows = Rows(ReadText(Path("c.csv")));
  EXPECT_EQ(rows[0],
            (std::vector<std::string>{"stamp_ns", "led", "u_px", "v_px", "sigma_px", "peak"}));
  EXPECT_EQ(rows.size(), 1u + 10u * 5u + 4u) << "ten frames of five LEDs, one of four, one missing";
  std::array<int, 5> seen{};
  for (std::size_t i = 1; i < rows.size(); ++i) {
    ASSERT_EQ(rows[i].size(), 6u);
    ASSERT_EQ(rows[i][1].size(), 2u) << "each spot is one of P1 .. P5";
    ++seen[static_cast<std::size_t>(rows[i][1][1] - '1')];
  }
  EXPECT_EQ(seen, (std::array<int, 5>{11, 10, 11, 11, 11}));
}

TEST_F(Tbm, NothingIsWrittenOverAnExistingFileUnlessForced) {
  WriteText(Path("p.csv"), "mine");
  EXPECT_EQ(Run("solve " + kRun + " --out " + Path("p.csv")), 2);
  EXPECT_THAT(err_, HasSubstr("exists already"));
  EXPECT_EQ(ReadText(Path("p.csv")), "mine");
  EXPECT_EQ(Run("solve " + kRun + " --out " + Path("p.csv") + " --force"), 0);
  EXPECT_NE(ReadText(Path("p.csv")), "mine");
}

TEST_F(Tbm, WrongCommandLinesExitWithTwo) {
  const std::vector<std::string> wrong = {"",
                                          "dig",
                                          "solve",
                                          "solve " + kRun,
                                          "solve " + kRun + " --out x --method guess",
                                          "solve " + kRun + " --out x --format xml",
                                          "check a b",
                                          "completion fish",
                                          "study weather",
                                          "solve /nowhere --out " + Path("never.csv")};
  for (const std::string& arguments : wrong) {
    EXPECT_EQ(Run(arguments), 2) << arguments;
    EXPECT_NE(err_, "") << arguments;
  }
}

TEST_F(Tbm, ABadFileExitsWithTwoAndNamesItsLine) {
  const std::string run = CopiedRun();
  std::ofstream(run + "/tilt.csv", std::ios::app) << "1790000003000000000,target,abc,0.1\n";
  EXPECT_EQ(Run("solve " + run + " --out " + Path("p.csv")), 2);
  EXPECT_THAT(err_, HasSubstr("tilt.csv:74: column beta_deg: 'abc' is not a number"));
  EXPECT_FALSE(fs::exists(Path("p.csv")));
}

TEST_F(Tbm, HelpAndVersionExitWithZero) {
  for (const std::string arguments : {"--help",
                                      "solve --help",
                                      "centres --help",
                                      "check --help",
                                      "watch --help",
                                      "calibrate --help",
                                      "calibrate camera --help",
                                      "calibrate tilt --help",
                                      "calibrate target --help",
                                      "calibrate rig --help"}) {
    EXPECT_EQ(Run(arguments), 0) << arguments;
    EXPECT_THAT(out_, HasSubstr("Example")) << arguments;
    EXPECT_EQ(err_, "");
  }
  EXPECT_EQ(Run("--version"), 0);
  EXPECT_THAT(out_, ::testing::MatchesRegex("tbm [0-9]+\\.[0-9]+\\.[0-9]+\n"));
}

TEST_F(Tbm, APipeIsSilentAndATerminalSeesProgress) {
  const std::string run = CopiedRun();
  fs::copy_file(
      run + "/frames/000007.png", run + "/frames/000008.png", fs::copy_options::overwrite_existing);
  ASSERT_EQ(Run("solve " + run + " --out " + Path("p.csv")), 0);
  EXPECT_EQ(out_, "");
  EXPECT_EQ(err_, "");

  int terminal = -1;
  const pid_t child = forkpty(&terminal, nullptr, nullptr, nullptr);
  ASSERT_GE(child, 0);
  if (child == 0) {
    execl(TBM_PROGRAM,
          "tbm",
          "solve",
          run.c_str(),
          "--out",
          Path("q.csv").c_str(),
          static_cast<char*>(nullptr));
    _exit(127);
  }
  std::string seen;
  std::array<char, 4096> piece{};
  for (ssize_t count = 0; (count = read(terminal, piece.data(), piece.size())) > 0;) {
    seen.append(piece.data(), static_cast<std::size_t>(count));
  }
  int status = 0;
  waitpid(child, &status, 0);
  close(terminal);
  EXPECT_EQ(status, 0);
  EXPECT_THAT(seen, HasSubstr("solving ["));
  EXPECT_THAT(seen, HasSubstr("12 frames"));
  EXPECT_EQ(ReadText(Path("p.csv")), ReadText(Path("q.csv")));
}

// Whenever it is killed, the output is not there or whole.
TEST_F(Tbm, KilledAtAnyTimeItLeavesNoHalfFile) {
  ASSERT_EQ(Run("solve " + kRun + " --out " + Path("whole.csv")), 0);
  const std::string whole = ReadText(Path("whole.csv"));
  const std::string out = Path("p.csv");
  int finished = 0;
  for (int i = 0; i < 30; ++i) {
    fs::remove(out);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      // The complaint about the missing frame is not wanted among the test's own lines.
      std::freopen("/dev/null", "w", stderr);
      execl(TBM_PROGRAM,
            "tbm",
            "solve",
            kRun.c_str(),
            "--out",
            out.c_str(),
            static_cast<char*>(nullptr));
      _exit(127);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(25 * i));
    kill(child, SIGKILL);
    int status = 0;
    waitpid(child, &status, 0);
    if (!fs::exists(out)) continue;
    ++finished;
    EXPECT_EQ(ReadText(out), whole);
  }
  SUCCEED() << finished << " of 30 had finished";
}

TEST_F(Tbm, TheStudyIsTheSameForAnyNumberOfThreadsAndShowsWhatTheTiltsBuy) {
  const std::string quick = "study published --draws 200 --out ";
  ASSERT_EQ(Run(quick + Path("a") + " --threads 1"), 0) << err_;
  ASSERT_EQ(Run(quick + Path("b") + " --threads 3"), 0) << err_;
  EXPECT_EQ(ReadText(Path("a/study.csv")), ReadText(Path("b/study.csv")));
  for (const char* picture : {"a/study_rmse.png", "a/study_mean.png"}) {
    EXPECT_THAT(ReadText(Path(picture)), ::testing::StartsWith("\x89PNG"));
  }
  const auto rows = Rows(ReadText(Path("a/study.csv")));
  ASSERT_EQ(rows.size(), 1u + 3u * 10u);
  EXPECT_EQ(rows[0][4], "roll_rmse_deg");
  EXPECT_EQ(rows[0][8], "pitch_rmse_deg");
  EXPECT_EQ(rows[0][9], "pitch_bound_deg");
  for (std::size_t i = 1; i < rows.size(); i += 3) {
    const double vision_deg = std::stod(rows[i][8]);
    const double fused_deg = std::stod(rows[i + 2][8]);
    EXPECT_EQ(rows[i][1], "vision");
    EXPECT_EQ(rows[i + 2][1], "fused");
    EXPECT_LT(fused_deg, 0.3 * vision_deg) << "pitch at " << rows[i][0] << " px";
    EXPECT_NEAR(fused_deg / std::stod(rows[i + 2][9]), 1.0, 0.2) << "at its bound";
  }
  EXPECT_EQ(Run(quick + Path("a")), 2) << "not over existing results";
}

TEST_F(Tbm, AxisCommandsTakeTheirOptions) {
  const std::string file = TBM_SOURCE_DIR "/tests/data/axis/example.xml";
  ASSERT_EQ(Run("axis eval --at 10250,10655 " + file + " --origin 4000 12000 400"), 0) << err_;
  const auto rows = Rows(out_);
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[2][1], "10685.000000");
  EXPECT_NEAR(std::stod(rows[1][3]), 666.986454, 2e-6) << "example_table.csv less 4000";
  EXPECT_EQ(Run("axis eval " + file + " --official --at 10690"), 0);
  EXPECT_EQ(Rows(out_).size(), 3u) << "the number stands twice";
  EXPECT_EQ(Run("axis eval " + file + " --at 10250 --from 10000"), 2);
  EXPECT_EQ(Run("axis project " + file + " " TBM_SOURCE_DIR "/tests/data/axis/example_shots.csv"),
            0);
  EXPECT_EQ(Rows(out_).size(), 17u);
  EXPECT_EQ(Run("axis check " + file + " --format json"), 0);
  EXPECT_EQ(nlohmann::json::parse(out_)["usable"], true);
  EXPECT_EQ(Run("axis check " + file + " --alignment south"), 2);
  EXPECT_THAT(err_, HasSubstr("'north tube'"));
  EXPECT_EQ(Run("axis"), 2);
}

// From what comes home from the workshop to a rig file, by the program alone.
TEST_F(Tbm, CalibrateMakesARigFileOfPicturesTiltsAndPoints) {
  const Rig truth = test::FieldRig();
  for (const char* folder : {"pictures", "table", "placements"}) fs::create_directory(Path(folder));
  test::MakeCameraPictures(Path("pictures"));
  test::MakeTiltPictures(Path("table"), test::LevelTable(truth.camera_tilt.tilt_from_body));
  test::MakeBoardSurvey(Path("placements"), {.rig = truth});
  WriteText(Path("drawing.csv"),
            "led,x_mm,y_mm,z_mm\nP1,-250,0,100\nP2,250,0,100\nP3,0,250,0\nP4,0,-250,0\n"
            "P5,80,80,250\n");
  WriteText(Path("points.yaml"),
            "rig_name: workshop\npoints:\n  shield_head: {xyz_mm: [0, 0, -1600], sigma_mm: 0.2}\n");
  const std::string board = " --board " + std::string(test::kWorkshopBoard);

  ASSERT_EQ(Run("calibrate camera " + Path("pictures") + board + " --out " + Path("camera.yaml") +
                " --picture " + Path("residuals.png") + " --coverage " + Path("coverage.png")),
            0)
      << err_;
  EXPECT_THAT(out_, HasSubstr("18 pictures"));
  EXPECT_THAT(ReadText(Path("residuals.png")), ::testing::StartsWith("\x89PNG"));
  const std::string tilt = "calibrate tilt " + Path("table") + " --camera " + Path("camera.yaml") +
                           " --out " + Path("tilt.yaml") + " --up 0 -1 0";
  EXPECT_EQ(Run(tilt + " --board chessboard:9x7:25"), 2);
  EXPECT_THAT(err_, HasSubstr("looks the same when turned"));
  ASSERT_EQ(Run(tilt + board), 0) << err_;
  EXPECT_THAT(out_, HasSubstr("12 placements"));
  ASSERT_EQ(Run("calibrate target " + Path("placements") + " --nominal " + Path("drawing.csv") +
                " --sigma-mm 0.1 --out " + Path("target.yaml")),
            0)
      << err_;
  EXPECT_THAT(out_, HasSubstr("5 LEDs, 6 placements, 30 points"));
  const std::string rig = "calibrate rig --camera " + Path("camera.yaml") + " --tilt " +
                          Path("tilt.yaml") + " --target " + Path("target.yaml") + " --points " +
                          Path("points.yaml") + " --distance-m 2 --out " + Path("rig.yaml");
  ASSERT_EQ(Run(rig), 0) << err_;
  EXPECT_EQ(err_, "");
  EXPECT_THAT(out_, HasSubstr("shield_head, 3.69 m"));
  EXPECT_THAT(out_, Not(HasSubstr("not known")));
  EXPECT_EQ(Run(rig), 2) << "not over an existing file";

  const auto loaded = LoadRigFile(Path("rig.yaml"));
  ASSERT_TRUE(loaded.has_value()) << loaded.error()[0].Text();
  EXPECT_TRUE(loaded->warnings.empty());
  EXPECT_EQ(loaded->rig.name, "workshop");
  for (const auto mount : {&Rig::camera_tilt, &Rig::target_tilt}) {
    const TiltMount& found = loaded->rig.*mount;
    const Eigen::Vector3d off =
        found.tilt_from_body.transpose().col(2) - (truth.*mount).tilt_from_body.transpose().col(2);
    EXPECT_LT(off.norm(), 0.0017) << "a tenth of a degree, the principal point's share included";
    EXPECT_GT(found.mounting_sigma_rad, 1e-5);
    EXPECT_LT(found.mounting_sigma_rad, 1e-3);
  }
  EXPECT_EQ(Run("calibrate"), 2);
  EXPECT_EQ(Run("calibrate rig --camera x --out y"), 2);
  EXPECT_EQ(Run("calibrate target x --nominal y --out z --sign 2 1"), 2);
}

TEST_F(Tbm, CompletionKnowsCommandsOptionsAndChoices) {
  ASSERT_EQ(Run("completion bash"), 0);
  const std::string script = Path("tbm.bash");
  WriteText(script, out_);
  const auto complete = [&](const std::string& words, int index) {
    const std::string command = "bash -c 'source " + script + "; COMP_WORDS=(" + words +
                                "); COMP_CWORD=" + std::to_string(index) +
                                "; compopt() { :; }; _tbm; echo \"${COMPREPLY[*]}\"' > '" +
                                Path("reply") + "'";
    EXPECT_EQ(std::system(command.c_str()), 0);
    return ReadText(Path("reply"));
  };
  EXPECT_EQ(complete("tbm so", 1), "solve\n");
  EXPECT_EQ(complete("tbm solve --met", 2), "--method\n");
  EXPECT_EQ(complete("tbm solve --method v", 3), "vision\n");
  EXPECT_EQ(complete("tbm completion z", 2), "zsh\n");
  EXPECT_EQ(complete("tbm axis ev", 2), "eval\n");
  EXPECT_EQ(complete("tbm axis check --format j", 4), "json\n");
  EXPECT_EQ(complete("tbm calibrate ta", 2), "target\n");
  EXPECT_EQ(complete("tbm calibrate rig --dis", 3), "--distance-m\n");
  ASSERT_EQ(Run("completion zsh"), 0);
  EXPECT_THAT(out_, HasSubstr("'--method[estimator]:value:(fused published vision)'"));
}

}  // namespace
}  // namespace tbm
