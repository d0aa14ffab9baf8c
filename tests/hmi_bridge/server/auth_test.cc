#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "hmi_bridge/server/auth_files.h"
#include "hmi_bridge/server/auth_store.h"
#include "hmi_bridge/server/secrets.h"
#include "hmi_bridge/server/tls_files.h"
#include "tests/support/fake_clock.h"
#include "tests/support/random.h"
#include "tests/support/temp_folder.h"

namespace tbm::hmi {
namespace {

using tbm::test::ReadText;
using tbm::test::WriteText;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using namespace std::chrono_literals;

constexpr const char* kPassword = "grease and granite";

AuthLimits Cheap() {
  AuthLimits limits;
  limits.log2_n = kLeastLog2N;
  return limits;
}

unsigned ModeOf(const std::string& path) {
  struct stat status = {};
  EXPECT_EQ(::stat(path.c_str(), &status), 0) << path;
  return status.st_mode & 0777u;
}

class Auth : public ::testing::Test {
 protected:
  std::unique_ptr<AuthStore> Open(AuthLimits limits = Cheap()) {
    auto store = AuthStore::Open(state_, clock_, limits);
    EXPECT_TRUE(store) << store.error();
    return std::move(store).value();
  }
  std::string FaultOfOpening() {
    const auto store = AuthStore::Open(state_, clock_, Cheap());
    return store ? "" : store.error();
  }
  static std::string LogIn(AuthStore& store, const std::string& name, const char* password) {
    const auto opened = store.LogIn(name, password);
    EXPECT_TRUE(opened);
    return opened && *opened ? (**opened).token : "";
  }
  std::string operator/(const char* name) const { return state_ + "/" + name; }

  tbm::test::TempFolder folder_;
  std::string state_ = folder_ / "state";
  tbm::test::FakeClock clock_;
};

TEST_F(Auth, FirstStartMakesASurveyorWithAPasswordOfItsOwn) {
  const auto store = Open();
  const auto first = store->MakeFirstUser();
  ASSERT_TRUE(first && first->has_value());
  EXPECT_EQ((*first)->name, "surveyor");
  EXPECT_EQ((*first)->password.size(), 20u);
  EXPECT_EQ(ReadText(*this / "first_password.txt"), (*first)->password + "\n");
  EXPECT_EQ(ModeOf(*this / "first_password.txt"), 0600u);
  EXPECT_EQ(ModeOf(*this / "users.json"), 0600u);
  EXPECT_EQ(ModeOf(state_), 0700u);
  EXPECT_THAT(ReadText(*this / "users.json"), Not(HasSubstr((*first)->password)));
  EXPECT_NE(LogIn(*store, "surveyor", (*first)->password.c_str()), "");

  const auto again = store->MakeFirstUser();
  ASSERT_TRUE(again);
  EXPECT_FALSE(again->has_value());

  ASSERT_EQ(store->SetPassword("surveyor", kPassword), std::nullopt);
  EXPECT_FALSE(std::filesystem::exists(*this / "first_password.txt"));
  EXPECT_EQ(LogIn(*store, "surveyor", (*first)->password.c_str()), "");
}

TEST_F(Auth, FirstPasswordsDiffer) {
  EXPECT_NE(RandomPassword(), RandomPassword());
  EXPECT_NE(RandomToken(32), RandomToken(32));
  EXPECT_EQ(RandomToken(32).size(), 43u);
}

TEST_F(Auth, WrongNameAndWrongPasswordAreRefusedAlike) {
  const auto store = Open();
  ASSERT_EQ(store->AddUser("ada", Role::kOperator, kPassword), std::nullopt);
  EXPECT_EQ(LogIn(*store, "ada", "grease and granitf"), "");
  EXPECT_EQ(LogIn(*store, "ada", ""), "");
  EXPECT_EQ(LogIn(*store, "eve", kPassword), "");
  const std::string token = LogIn(*store, "ada", kPassword);
  const auto identity = store->OfSession(token);
  ASSERT_TRUE(identity);
  EXPECT_EQ(identity->name, "ada");
  EXPECT_EQ(identity->role, Role::kOperator);
  EXPECT_FALSE(identity->is_token);
}

TEST_F(Auth, OnlyTheExactTokenOpens) {
  const auto store = Open();
  ASSERT_EQ(store->AddUser("ada", Role::kOperator, kPassword), std::nullopt);
  const std::string token = LogIn(*store, "ada", kPassword);
  for (std::size_t i = 0; i < token.size(); ++i) {
    std::string other = token;
    other[i] = static_cast<char>(other[i] ^ 1);
    EXPECT_FALSE(store->OfSession(other)) << i;
  }
  EXPECT_FALSE(store->OfSession(""));
  EXPECT_FALSE(store->OfSession(Sha256Hex(token))) << "what stands in the file opens nothing";
  EXPECT_FALSE(store->OfReadToken(token)) << "a session is no read token";
  EXPECT_THAT(ReadText(*this / "sessions.json"), Not(HasSubstr(token)));
}

TEST_F(Auth, SessionsOutliveARestartAndLogoutEndsThem) {
  std::string token;
  {
    const auto store = Open();
    ASSERT_EQ(store->AddUser("ada", Role::kOperator, kPassword), std::nullopt);
    token = LogIn(*store, "ada", kPassword);
  }
  const auto store = Open();
  const auto identity = store->OfSession(token);
  ASSERT_TRUE(identity);
  EXPECT_TRUE(store->StillHolds(*identity));
  EXPECT_EQ(store->LogOut(identity->token_sha256), std::nullopt);
  EXPECT_FALSE(store->OfSession(token));
  EXPECT_FALSE(store->StillHolds(*identity));
  EXPECT_FALSE(Open()->OfSession(token)) << "nor after the next start";
}

TEST_F(Auth, TwelveHoursUnusedOrSevenDaysEndASession) {
  const auto store = Open();
  ASSERT_EQ(store->AddUser("ada", Role::kOperator, kPassword), std::nullopt);
  std::string token = LogIn(*store, "ada", kPassword);
  clock_.Advance(12h - 1s);
  ASSERT_TRUE(store->OfSession(token));
  clock_.Advance(12h);
  EXPECT_FALSE(store->OfSession(token));

  token = LogIn(*store, "ada", kPassword);
  for (int hour = 0; hour < 7 * 24 - 1; ++hour) {
    clock_.Advance(1h);
    ASSERT_TRUE(store->OfSession(token)) << hour;
  }
  clock_.Advance(1h);
  EXPECT_FALSE(store->OfSession(token));
}

TEST_F(Auth, UsesAreKeptNowAndThen) {
  auto store = Open();
  ASSERT_EQ(store->AddUser("ada", Role::kOperator, kPassword), std::nullopt);
  const std::string token = LogIn(*store, "ada", kPassword);
  const std::string before = ReadText(*this / "sessions.json");
  clock_.Advance(4min);
  ASSERT_TRUE(store->OfSession(token));
  EXPECT_EQ(store->KeepUses(), std::nullopt);
  EXPECT_EQ(ReadText(*this / "sessions.json"), before);
  clock_.Advance(10h);
  ASSERT_TRUE(store->OfSession(token));
  EXPECT_EQ(store->KeepUses(), std::nullopt);
  EXPECT_NE(ReadText(*this / "sessions.json"), before);
  store = Open();
  clock_.Advance(10h);
  EXPECT_TRUE(store->OfSession(token)) << "20 h after the log-in, 10 h after the last use";
}

TEST_F(Auth, AClockFarBackEndsNoSessionForGood) {
  const auto store = Open();
  ASSERT_EQ(store->AddUser("ada", Role::kOperator, kPassword), std::nullopt);
  const std::string token = LogIn(*store, "ada", kPassword);
  clock_.StepCivilTime(-24h * 365);
  EXPECT_FALSE(store->OfSession(token)) << "or it would live a year longer";
  clock_.StepCivilTime(24h * 365);
  EXPECT_TRUE(store->OfSession(token));
}

TEST_F(Auth, AnotherPasswordOrRoleEndsItsSessionsAndNoOthers) {
  const auto store = Open();
  ASSERT_EQ(store->AddUser("ada", Role::kOperator, kPassword), std::nullopt);
  ASSERT_EQ(store->AddUser("bob", Role::kViewer, kPassword), std::nullopt);
  const std::string bob = LogIn(*store, "bob", kPassword);
  std::string ada = LogIn(*store, "ada", kPassword);
  ASSERT_EQ(store->SetPassword("ada", "another good one"), std::nullopt);
  EXPECT_FALSE(store->OfSession(ada));
  ada = LogIn(*store, "ada", "another good one");
  ASSERT_EQ(store->SetRole("ada", Role::kViewer), std::nullopt);
  EXPECT_FALSE(store->OfSession(ada));
  ada = LogIn(*store, "ada", "another good one");
  ASSERT_TRUE(store->OfSession(ada));
  ASSERT_EQ(store->RemoveUser("ada"), std::nullopt);
  EXPECT_FALSE(store->OfSession(ada));
  ASSERT_EQ(store->AddUser("ada", Role::kSurveyor, kPassword), std::nullopt);
  EXPECT_FALSE(store->OfSession(ada)) << "another person of that name";
  EXPECT_TRUE(store->OfSession(bob));
  EXPECT_THAT(store->RemoveUser("carl").value_or(""), HasSubstr("carl"));
  ASSERT_EQ(store->RemoveUser("ada"), std::nullopt);
  EXPECT_THAT(store->RemoveUser("bob").value_or(""), HasSubstr("last user"));
}

TEST_F(Auth, WhatTheCommandLineChangesTheBridgeSeesWithinASecond) {
  const auto bridge = Open();
  ASSERT_EQ(bridge->AddUser("bob", Role::kViewer, kPassword), std::nullopt);
  const std::string bob = LogIn(*bridge, "bob", kPassword);
  const auto shell = Open();
  ASSERT_EQ(shell->AddUser("ada", Role::kOperator, kPassword), std::nullopt);
  const auto read = shell->AddToken("grafana");
  ASSERT_TRUE(read);
  EXPECT_EQ(LogIn(*bridge, "ada", kPassword), "") << "files are looked at once a second";
  clock_.Advance(1s);
  EXPECT_NE(LogIn(*bridge, "ada", kPassword), "");
  ASSERT_TRUE(bridge->OfReadToken(*read));
  EXPECT_EQ(bridge->OfReadToken(*read)->role, Role::kViewer);
  ASSERT_EQ(shell->RemoveUser("bob"), std::nullopt);
  ASSERT_EQ(shell->RemoveToken("grafana"), std::nullopt);
  clock_.Advance(1s);
  EXPECT_FALSE(bridge->OfSession(bob));
  EXPECT_FALSE(bridge->OfReadToken(*read));
}

TEST_F(Auth, TwoWritersLoseNothing) {
  const auto one = Open();
  const auto other = Open();
  for (int i = 0; i < 5; ++i) {
    ASSERT_EQ(one->AddUser("a" + std::to_string(i), Role::kViewer, kPassword), std::nullopt);
    ASSERT_EQ(other->AddUser("b" + std::to_string(i), Role::kViewer, kPassword), std::nullopt);
  }
  EXPECT_EQ(Open()->ListUsers().size(), 10u);
  EXPECT_THAT(one->AddUser("b1", Role::kViewer, kPassword).value_or(""),
              HasSubstr("there already"));
}

TEST_F(Auth, SessionsAreBounded) {
  AuthLimits limits = Cheap();
  limits.sessions = 3;
  const auto store = Open(limits);
  ASSERT_EQ(store->AddUser("ada", Role::kOperator, kPassword), std::nullopt);
  std::vector<std::string> tokens;
  for (int i = 0; i < 4; ++i) {
    clock_.Advance(1s);
    tokens.push_back(LogIn(*store, "ada", kPassword));
  }
  EXPECT_FALSE(store->OfSession(tokens[0]));
  EXPECT_TRUE(store->OfSession(tokens[1]));
  EXPECT_TRUE(store->OfSession(tokens[3]));
  EXPECT_EQ(store->ListUsers()[0].open_sessions, 3u);
}

TEST_F(Auth, EasyPasswordsAndOddNamesAreRefused) {
  const auto store = Open();
  for (const char* easy : {"short",
                           "12345678901",
                           "passwordpassword",
                           "Ada.Lovelace12",
                           "aaaaaaaaaaaaaaaa",
                           "tunnel123456",
                           "surveyor2024!"}) {
    EXPECT_NE(store->AddUser("ada.lovelace", Role::kViewer, easy), std::nullopt) << easy;
  }
  for (const char* odd : {"", "a b", "a\nb", "a\r\nSet-Cookie: x", "../x", "\xff", "a\"b"}) {
    EXPECT_NE(store->AddUser(odd, Role::kViewer, kPassword), std::nullopt) << odd;
    EXPECT_FALSE(store->AddToken(odd)) << odd;
  }
  EXPECT_EQ(store->AddUser(std::string(33, 'a'), Role::kViewer, kPassword).has_value(), true);
  EXPECT_TRUE(store->ListUsers().empty());
}

TEST_F(Auth, WhatOthersCanReadIsRefused) {
  { ASSERT_EQ(Open()->AddUser("ada", Role::kOperator, kPassword), std::nullopt); }
  ::chmod((*this / "users.json").c_str(), 0640);
  EXPECT_THAT(FaultOfOpening(), HasSubstr("chmod 600"));
  ::chmod((*this / "users.json").c_str(), 0600);
  ::chmod(state_.c_str(), 0750);
  EXPECT_THAT(FaultOfOpening(), HasSubstr("chmod 700"));
  ::chmod(state_.c_str(), 0700);
  EXPECT_EQ(FaultOfOpening(), "");
  std::filesystem::rename(*this / "users.json", folder_ / "elsewhere");
  std::filesystem::create_symlink(folder_ / "elsewhere", *this / "users.json");
  EXPECT_THAT(FaultOfOpening(), HasSubstr("users.json: cannot be read"));
}

TEST_F(Auth, ADamagedFileIsNeverAnEmptyOne) {
  std::string users;
  {
    const auto store = Open();
    ASSERT_EQ(store->AddUser("ada", Role::kOperator, kPassword), std::nullopt);
    LogIn(*store, "ada", kPassword);
    ASSERT_TRUE(store->AddToken("grafana"));
    users = ReadText(*this / "users.json");
  }
  for (const char* name : {"users.json", "sessions.json", "tokens.json"}) {
    const std::string whole = ReadText(*this / name);
    for (std::size_t size = 0; size + 2 < whole.size(); size += 7) {
      WriteText(*this / name, whole.substr(0, size));
      EXPECT_THAT(FaultOfOpening(), StartsWith(*this / name)) << size;
    }
    WriteText(*this / name, whole);
  }
  // While it runs: what was read stays, and nothing is written over what may still be saved.
  const auto store = Open();
  WriteText(*this / "users.json", users.substr(0, 40));
  clock_.Advance(2s);
  EXPECT_NE(LogIn(*store, "ada", kPassword), "");
  const auto faults = store->TakeFaults();
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_THAT(faults[0], HasSubstr("users.json"));
  EXPECT_THAT(store->AddUser("bob", Role::kViewer, kPassword).value_or(""),
              HasSubstr("users.json"));
  EXPECT_EQ(ReadText(*this / "users.json"), users.substr(0, 40));
}

struct BadFile {
  const char* text;
  const char* says;
};

TEST(AuthFiles, FaultsNameThePlaceAndWhatWouldBeRight) {
  const BadFile cases[] = {
      {R"([])", "file must be an object"},
      {R"({"version":2,"users":[]})", "file.version must be a whole number from 1 to 1"},
      {R"({"version":1})", "file.users is missing"},
      {R"({"version":1,"users":[],"more":1})", "file.more is not known"},
      {R"({"version":1,"users":{}})", "users must be a list"},
      {R"({"version":1,"users":[7]})", "users[0] must be an object"},
      {R"({"version":1,"users":[{"name":"a b","role":"viewer","edition":"0011223344556677","scrypt":{}}]})",
       "users[0].name must be 1 to 32 letters"},
      {R"({"version":1,"users":[{"name":"a","role":"root","edition":"0011223344556677","scrypt":{}}]})",
       "users[0].role must be viewer, operator or surveyor"},
      {R"({"version":1,"users":[{"name":"a","role":"viewer","edition":"00","scrypt":{}}]})",
       "users[0].edition must be 16 digits"},
      {R"({"version":1,"users":[{"name":"a","role":"viewer","edition":"0011223344556677","scrypt":{"log2_n":40,"r":8,"p":1,"salt":"00112233445566770011223344556677","key":"00"}}]})",
       "users[0].scrypt.log2_n must be a whole number from 10 to 18"},
      {R"({"version":1,"users":[[[[[[]]]]]]})", "nested too deeply"},
  };
  for (const BadFile& bad : cases) {
    const auto users = ParseUsers(bad.text, "state/users.json");
    ASSERT_FALSE(users) << bad.text;
    EXPECT_THAT(users.error(), StartsWith("state/users.json: ")) << bad.text;
    EXPECT_THAT(users.error(), HasSubstr(bad.says)) << bad.text;
  }
}

TEST(AuthFiles, WhatIsWrittenIsReadBack) {
  const std::vector<User> users = {
      {"ada", Role::kSurveyor, "0011223344556677", HashOf("x", kLeastLog2N)},
      {"bob", Role::kViewer, "8899aabbccddeeff", HashOf("y", kLeastLog2N + 1)}};
  const auto read = ParseUsers(TextOf(users), "f");
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(TextOf(*read), TextOf(users));
  EXPECT_EQ((*read)[1].password.log2_n, kLeastLog2N + 1);
  EXPECT_TRUE(IsPassword((*read)[1].password, "y"));
  EXPECT_FALSE(IsPassword((*read)[1].password, "x"));
  // Any byte changed: refused, or another valid file; never a crash, never a second reading.
  const std::string text = TextOf(users);
  tbm::test::Random random("auth_files");
  for (int i = 0; i < 400; ++i) {
    std::string bad = text;
    bad[static_cast<std::size_t>(random.Index(static_cast<int>(bad.size())))] =
        static_cast<char>(random.Index(256));
    const auto other = ParseUsers(bad, "f");
    if (!other) continue;
    EXPECT_EQ(TextOf(*ParseUsers(TextOf(*other), "f")), TextOf(*other));
  }
}

TEST(Secrets, ScryptIsTheStandardOne) {
  // RFC 7914, section 12: P "pleaseletmein", S "SodiumChloride", N 16384, r 8, p 1; first 32 bytes.
  PasswordHash hash{14, 8, 1, "SodiumChloride", ""};
  hash.key = *FromHex("7023bdcb3afd7348461c06cd81fd38ebfda8fbba904f8e3ea9b543f6545da1f2");
  EXPECT_TRUE(IsPassword(hash, "pleaseletmein"));
  EXPECT_FALSE(IsPassword(hash, "pleaseletmeiN"));
  EXPECT_EQ(HashOf("x", kLeastLog2N).salt.size(), 16u);
  EXPECT_NE(HashOf("x", kLeastLog2N).key, HashOf("x", kLeastLog2N).key);
  EXPECT_EQ(AuthLimits{}.log2_n, 15);
}

TEST_F(Auth, ASelfSignedCertificateIsForItsNames) {
  const auto made = MakeSelfSigned(state_, {"127.0.0.1", "tbm-panel", "::1"}, clock_);
  ASSERT_TRUE(made) << made.error();
  EXPECT_EQ(made->sha256.size(), 95u);
  EXPECT_EQ(ModeOf(made->files.key_pem), 0600u);
  EXPECT_EQ(WhyNotTls(made->files), std::nullopt);
  EXPECT_FALSE(MakeSelfSigned(state_, {"a,DNS:evil"}, clock_));
  EXPECT_FALSE(MakeSelfSigned(state_, {}, clock_));

  const std::string other = folder_ / "other";
  const auto another = MakeSelfSigned(other, {"localhost"}, clock_);
  ASSERT_TRUE(another);
  EXPECT_THAT(WhyNotTls({made->files.certificate_pem, another->files.key_pem}).value_or(""),
              HasSubstr("does not belong"));
  EXPECT_THAT(WhyNotTls({made->files.certificate_pem, other + "/none"}).value_or(""),
              HasSubstr("cannot be read"));
  EXPECT_THAT(WhyNotTls({made->files.key_pem, made->files.key_pem}).value_or(""),
              HasSubstr("is no PEM certificate"));
}

}  // namespace
}  // namespace tbm::hmi
