#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hmi_bridge/server/json_text.h"
#include "hmi_bridge/server/origin.h"
#include "hmi_bridge/server/query.h"
#include "hmi_bridge/server/tls_files.h"
#include "tests/hmi_bridge/server/gate_fixture.h"

namespace tbm::hmi {
namespace {

using tbm::test::WriteText;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using namespace std::chrono_literals;

TEST_F(Gate, LoginSetsACookieThatScriptsAndForeignPagesCannotUse) {
  const Response response = Answer(LoginAs("otto", kPassword));
  EXPECT_EQ(response.status, 200);
  const Json me = Json::parse(Body(response));
  EXPECT_EQ(me["name"], "otto");
  EXPECT_EQ(me["role"], "operator");
  EXPECT_EQ(me["expires_at_utc_ms"].get<std::int64_t>(),
            clock_.Now().ns / 1'000'000 + 12 * 3600 * 1000);
  const std::string cookie = Header(response, "Set-Cookie");
  EXPECT_THAT(cookie, HasSubstr("; HttpOnly"));
  EXPECT_THAT(cookie, HasSubstr("; SameSite=Strict"));
  EXPECT_THAT(cookie, HasSubstr("; Path=/"));
  EXPECT_THAT(cookie, Not(HasSubstr("Secure")));
  EXPECT_THAT(Body(response), Not(HasSubstr(cookie.substr(12, 43))));

  Request request = LoginAs("otto", kPassword);
  request.peer.is_tls = true;
  request.origin = "https://127.0.0.1:8080";
  const std::string secure = Header(Answer(request), "Set-Cookie");
  EXPECT_THAT(secure, testing::StartsWith("__Host-tbm_session="));
  EXPECT_THAT(secure, HasSubstr("; Secure"));
  ASSERT_FALSE(events_.empty());
  for (const ServerEvent& event : events_) {
    EXPECT_EQ(event.what, ServerEvent::What::kLoggedIn);
    EXPECT_EQ(event.name, "otto");
    EXPECT_EQ(event.text, "");
  }
}

TEST_F(Gate, WithoutSessionNothingIsTold) {
  for (const char* target : {"/api/me",
                             "/api/snapshot",
                             "/api/history?point=cutter_face",
                             "/api/advance?point=cutter_face",
                             "/metrics"}) {
    for (const char* cookie : {"", "tbm_session=", "tbm_session=AAAA", "other=1"}) {
      const Response response = Answer(Get(target, cookie));
      EXPECT_EQ(response.status, 401) << target;
      EXPECT_EQ(ErrorOf(response), "not_logged_in") << target;
    }
    EXPECT_EQ(Answer(Get(target, CookieOf("vera"))).status, 200) << target;
    Request with_token = Get(target);
    with_token.authorization = "Bearer " + read_token_;
    EXPECT_EQ(Answer(with_token).status, 200) << target;
    with_token.authorization = "Basic " + read_token_;
    EXPECT_EQ(Answer(with_token).status, 401) << target;
  }
  EXPECT_EQ(Answer(Post("/api/commands", "{}")).status, 401);
  EXPECT_EQ(Answer(Get("/healthz")).status, 200);
  EXPECT_EQ(Body(Answer(Get("/healthz"))), "ok");
  EXPECT_EQ(Body(Answer(Get("/api/openapi.yaml"))), options_.openapi_text);
}

TEST_F(Gate, ACookieIsWorthNothingAfterLogout) {
  const std::string cookie = CookieOf("otto");
  const std::string other = CookieOf("otto");
  const Response out = Answer(Post("/api/logout", "", cookie));
  EXPECT_EQ(out.status, 204);
  EXPECT_THAT(Header(out, "Set-Cookie"), HasSubstr("tbm_session=; "));
  EXPECT_THAT(Header(out, "Set-Cookie"), HasSubstr("Max-Age=0"));
  EXPECT_EQ(Answer(Get("/api/me", cookie)).status, 401);
  EXPECT_EQ(Answer(Get("/api/me", other)).status, 200);
  EXPECT_EQ(Answer(Post("/api/logout", "")).status, 204);
}

TEST_F(Gate, LoggingInTakesNoSessionThatTheBrowserBrought) {
  // Fixation: a session's name is always the server's choice, and the one before ends.
  const std::string before = CookieOf("vera");
  Request request = LoginAs("otto", kPassword);
  request.cookie = before + "; tbm_session=chosen";
  const std::string set = Header(Answer(request), "Set-Cookie");
  EXPECT_THAT(set, Not(HasSubstr("chosen")));
  EXPECT_EQ(Answer(Get("/api/me", before)).status, 401);
  EXPECT_EQ(Answer(Get("/api/me", "tbm_session=chosen")).status, 401);
}

TEST_F(Gate, RolesAreTheSourcesDecisionAndComeFromTheSession) {
  const std::string acknowledge =
      R"({"addressee":"guidance","verb":"acknowledge","argument":"guidance/deviation_high","because":"seen"})";
  const std::string move = R"({"addressee":"total_station","verb":"set_up"})";
  EXPECT_EQ(Answer(Post("/api/commands", acknowledge, CookieOf("vera"))).status, 403);
  EXPECT_EQ(counters_.Refused(Refusal::kRole), 1u);
  EXPECT_EQ(Answer(Post("/api/commands", acknowledge, CookieOf("otto"))).status, 202);
  EXPECT_EQ(Answer(Post("/api/commands", move, CookieOf("otto"))).status, 403);
  const Response sent = Answer(Post("/api/commands", move, CookieOf("sue")));
  EXPECT_EQ(sent.status, 202);
  EXPECT_EQ(Json::parse(Body(sent))["request_id"], "r1");
  EXPECT_THAT(source_.asked(),
              ElementsAre("vera/guidance/acknowledge/guidance/deviation_high/seen",
                          "otto/guidance/acknowledge/guidance/deviation_high/seen",
                          "otto/total_station/set_up//",
                          "sue/total_station/set_up//"));
  Request by_token = Post("/api/commands", acknowledge);
  by_token.authorization = "Bearer " + read_token_;
  EXPECT_EQ(Answer(by_token).status, 403) << "a read token reads";
}

TEST_F(Gate, ForeignPagesCannotPost) {
  const std::string cookie = CookieOf("sue");
  const std::string body = R"({"addressee":"a","verb":"b"})";
  for (const char* origin : {"http://evil.example",
                             "https://127.0.0.1:8080",
                             "http://127.0.0.1",
                             "http://127.0.0.1:80801",
                             "http://127.0.0.1:8080.evil.example",
                             "null",
                             ""}) {
    Request request = Post("/api/commands", body, cookie);
    request.origin = origin;
    EXPECT_EQ(Answer(request).status, 403) << origin;
    request = LoginAs("otto", kPassword);
    request.origin = origin;
    EXPECT_EQ(Answer(request).status, 403) << origin;
    request = Post("/api/logout", "", cookie);
    request.origin = origin;
    EXPECT_EQ(Answer(request).status, 403) << origin;
  }
  Request request = Post("/api/commands", body, cookie);
  request.has_origin = false;
  request.origin.clear();
  EXPECT_EQ(Answer(request).status, 403);
  request.fetch_site = "cross-site";
  EXPECT_EQ(Answer(request).status, 403);
  request.fetch_site = "same-origin";
  EXPECT_EQ(Answer(request).status, 202);
  request = Post("/api/commands", body, cookie);
  for (const char* type :
       {"", "text/plain", "application/x-www-form-urlencoded", "application/jsonp"}) {
    request.content_type = type;
    EXPECT_EQ(Answer(request).status, 415) << type;
  }
  request.content_type = "application/json; charset=utf-8";
  EXPECT_EQ(Answer(request).status, 202);
}

TEST_F(Gate, ForeignPagesCannotListen) {
  const std::string cookie = CookieOf("vera");
  constexpr const char* kLive = "tbm.console.v1";
  EXPECT_EQ(Answer(Socket("/api/live", cookie, kLive)).status, 101);
  EXPECT_EQ(Answer(Socket("/api/live", "", kLive)).status, 401);
  EXPECT_EQ(Answer(Socket("/api/live", cookie, "chat")).status, 426);
  EXPECT_EQ(Answer(Get("/api/live", cookie)).status, 403);
  Request foreign = Socket("/api/live", cookie, kLive);
  foreign.origin = "http://evil.example";
  EXPECT_EQ(Answer(foreign).status, 403);
  foreign.authorization = "Bearer " + read_token_;
  EXPECT_EQ(Answer(foreign).status, 403);
  Request program = Socket("/api/live", "", kLive);
  program.has_origin = false;
  program.origin.clear();
  EXPECT_EQ(Answer(program).status, 403);
  program.authorization = "Bearer " + read_token_;
  EXPECT_EQ(Answer(program).status, 101);
  program.authorization = "Bearer x" + read_token_;
  EXPECT_EQ(Answer(program).status, 401);
  program.authorization = "x";
  program.cookie = cookie;
  EXPECT_EQ(Answer(program).status, 401) << "a cookie without an origin, dressed as a token";
  EXPECT_EQ(counters_.Refused(Refusal::kForeignOrigin), 4u);
}

TEST_F(Gate, ToolsListenWithACookieFromHereOrATokenFromAnywhere) {
  const std::string cookie = CookieOf("vera");
  constexpr const char* kTool = "foxglove.websocket.v1";
  EXPECT_EQ(Answer(Socket("/foxglove", cookie, kTool)).status, 101);
  Request elsewhere = Socket("/foxglove", cookie, kTool);
  elsewhere.origin = "https://app.example";
  EXPECT_EQ(Answer(elsewhere).status, 403);
  elsewhere.has_origin = false;
  EXPECT_EQ(Answer(elsewhere).status, 403);
  elsewhere =
      Socket("/foxglove?token=" + read_token_, "", "foxglove.sdk.v1, foxglove.websocket.v1");
  elsewhere.origin = "https://app.example";
  EXPECT_EQ(Answer(elsewhere).status, 101);
  elsewhere = Socket("/foxglove?token=wrong", cookie, kTool);
  EXPECT_EQ(Answer(elsewhere).status, 401);
  EXPECT_EQ(Answer(Socket("/foxglove?tokn=" + read_token_, "", kTool)).status, 400);
  EXPECT_EQ(Answer(Socket("/foxglove", cookie, "foxglove.websocket.v2")).status, 426);
}

TEST_F(Gate, AForeignNameOfOurAddressIsRefused) {
  for (const char* host : {"evil.example",
                           "evil.example:8080",
                           "127.0.0.1.evil.example",
                           "127.0.0.1@evil.example",
                           "localhost:0",
                           "localhost:99999",
                           "localhost:8080:8080",
                           "[::1",
                           "[::1]x",
                           "10.0.0.9",
                           ""}) {
    Request request = Get("/healthz");
    request.host = host;
    const Response response = Answer(request);
    EXPECT_EQ(response.status, 421) << host;
    EXPECT_TRUE(response.must_close);
  }
  for (const char* host :
       {"127.0.0.1:8080", "localhost", "LOCALHOST:9000", "[::1]:8080", "Tbm-Panel"}) {
    Request request = Get("/healthz");
    request.host = host;
    EXPECT_EQ(Answer(request).status, 200) << host;
    request.has_one_host = false;
    EXPECT_EQ(Answer(request).status, 421) << host;
  }
  Request request = Get("/healthz");
  request.peer.local_address = "10.0.0.9";
  request.host = "10.0.0.9:8443";
  EXPECT_EQ(Answer(request).status, 200) << "the address it came to";
}

TEST_F(Gate, GuessingIsSlowForAnAddressAndForAName) {
  for (int i = 0; i < 5; ++i) EXPECT_EQ(Answer(LoginAs("otto", "wrong")).status, 401);
  Response limited = Answer(LoginAs("otto", kPassword));
  EXPECT_EQ(limited.status, 429);
  EXPECT_EQ(Header(limited, "Retry-After"), "10");
  EXPECT_EQ(Answer(LoginAs("sue", kPassword)).status, 429) << "the same address";
  Request elsewhere = LoginAs("otto", kPassword);
  elsewhere.peer.address = "10.1.1.1";
  EXPECT_EQ(Answer(elsewhere).status, 429) << "the same name";
  elsewhere = LoginAs("sue", kPassword);
  elsewhere.peer.address = "10.1.1.1";
  EXPECT_EQ(Answer(elsewhere).status, 200);
  clock_.Advance(10s);
  EXPECT_EQ(Answer(LoginAs("otto", kPassword)).status, 200) << "one in ten seconds";
  EXPECT_EQ(Answer(LoginAs("otto", kPassword)).status, 200) << "who is right is not slowed";
  EXPECT_EQ(events_.back().what, ServerEvent::What::kLoggedIn);
  EXPECT_EQ(counters_.logins_wrong.load(), 5u);
}

TEST_F(Gate, CommandsAreLimitedForAUser) {
  const std::string cookie = CookieOf("sue");
  const std::string body = R"({"addressee":"a","verb":"b"})";
  for (int i = 0; i < 10; ++i) EXPECT_EQ(Answer(Post("/api/commands", body, cookie)).status, 202);
  EXPECT_EQ(Answer(Post("/api/commands", body, cookie)).status, 429);
  EXPECT_EQ(Answer(Post("/api/commands", body, CookieOf("otto"))).status, 403);
  clock_.Advance(1s);
  EXPECT_EQ(Answer(Post("/api/commands", body, cookie)).status, 202);
}

TEST_F(Gate, ReportsAreForSurveyorsAndTheirFilesForAll) {
  const std::string body = R"({"kind":"axis_check"})";
  EXPECT_EQ(Answer(Post("/api/reports", body)).status, 401);
  EXPECT_EQ(Answer(Post("/api/reports", body, CookieOf("otto"))).status, 403);
  Request foreign = Post("/api/reports", body, CookieOf("sue"));
  foreign.origin = "http://evil.example";
  EXPECT_EQ(Answer(foreign).status, 403);
  const Response started = Answer(Post("/api/reports", body, CookieOf("sue")));
  EXPECT_EQ(started.status, 202);
  EXPECT_EQ(Json::parse(Body(started))["report_id"], "7");
  EXPECT_EQ(Answer(Post("/api/reports", std::string(9, '['), CookieOf("sue"))).status, 400);
  EXPECT_THAT(source_.asked(), ElementsAre("sue wants a report of 21 bytes"));
  const Response file = Answer(Get("/api/reports/7/axis_check.csv", CookieOf("vera")));
  EXPECT_EQ(file.status, 200);
  EXPECT_EQ(Header(file, "Content-Type"), "text/csv; charset=utf-8");
  EXPECT_EQ(Header(file, "Content-Disposition"), "attachment");
  EXPECT_EQ(Body(file), "chainage_m\n");
  EXPECT_EQ(Answer(Get("/api/reports/7/axis_check.csv")).status, 401);
  for (const char* path : {"7",
                           "7/",
                           "/axis_check.csv",
                           "7/none.csv",
                           "8/axis_check.csv",
                           "7/../axis_check.csv",
                           "../7",
                           "7/axis%5fcheck.csv",
                           "7/.axis_check.csv",
                           "7/axis_check.csv/",
                           "..",
                           "./."}) {
    EXPECT_EQ(Answer(Get(std::string("/api/reports/") + path, CookieOf("sue"))).status, 404)
        << path;
  }
  // Only who is logged in may send that much.
  EXPECT_EQ(router_->BodyLimit(Post("/api/reports", "")), options_.limits.body_bytes);
  EXPECT_EQ(router_->BodyLimit(Post("/api/commands", "", CookieOf("sue"))),
            options_.limits.body_bytes);
  EXPECT_EQ(router_->BodyLimit(Post("/api/reports", "", CookieOf("sue"))),
            options_.limits.report_bytes);
}

TEST_F(Gate, BodiesAreTakenExactly) {
  const std::string cookie = CookieOf("sue");
  struct Bad {
    const char* body;
    const char* says;
  };
  const Bad cases[] = {{"", "JSON object"},
                       {"[]", "JSON object"},
                       {"{", "JSON object"},
                       {"\"x\"", "JSON object"},
                       {R"({"verb":"b"})", "addressee is missing"},
                       {R"({"addressee":"a","verb":7})", "verb must be a text"},
                       {R"({"addressee":"a","verb":"b","role":"surveyor"})", "role is not known"},
                       {R"({"addressee":{"a":1},"verb":"b"})", "object of texts"},
                       {"{\"addressee\":\"\xff\",\"verb\":\"b\"}", "JSON object"}};
  for (const Bad& bad : cases) {
    const Response response = Answer(Post("/api/commands", bad.body, cookie));
    EXPECT_EQ(response.status, 400) << bad.body;
    EXPECT_EQ(ErrorOf(response), "bad_request") << bad.body;
    EXPECT_THAT(Body(response), HasSubstr(bad.says)) << bad.body;
  }
  const std::string bomb = std::string(8000, '[') + std::string(8000, ']');
  EXPECT_EQ(Answer(Post("/api/commands", bomb, cookie)).status, 400);
  EXPECT_TRUE(source_.asked().empty());
  // Brackets inside of texts are letters.
  EXPECT_EQ(
      Answer(Post("/api/commands", R"({"addressee":"a","verb":"b","because":"[[{{\"[["})", cookie))
          .status,
      202);
}

TEST_F(Gate, QuestionsAreTakenExactly) {
  const std::string cookie = CookieOf("vera");
  struct Bad {
    const char* query;
    const char* says;
  };
  const Bad cases[] = {{"", "point is missing"},
                       {"point=", "point is missing"},
                       {"point=a&point=b", "point is there twice"},
                       {"point=a&mots=3", "mots is not known"},
                       {"point=a&most=1", "most must be a number from 2 to 5000"},
                       {"point=a&most=2.5", "most must be a whole number"},
                       {"point=a&most=nan", "most must be"},
                       {"point=a&from_utc_ms=inf", "from_utc_ms must be"},
                       {"point=a&from_utc_ms=", "from_utc_ms must be"},
                       {"point=a&from_utc_ms=0x10", "from_utc_ms must be"},
                       {"point=a&from_utc_ms=2&to_utc_ms=1", "from_utc_ms is after"},
                       {"point=%4", "percent-encoded"},
                       {"point=%zz", "percent-encoded"},
                       {"point=%00", "percent-encoded"},
                       {"point=a%0d%0aSet-Cookie:x", "percent-encoded"},
                       {"=a", "has no name"},
                       {"&", "has no name"}};
  for (const Bad& bad : cases) {
    const Response response = Answer(Get(std::string("/api/history?") + bad.query, cookie));
    EXPECT_EQ(response.status, 400) << bad.query;
    EXPECT_THAT(Body(response), HasSubstr(bad.says)) << bad.query;
  }
  EXPECT_EQ(
      Answer(Get("/api/history?po%69nt=cutter%5Fface&most=20&from_utc_ms=1.5e3", cookie)).status,
      200);
  EXPECT_EQ(source_.history().point, "cutter_face");
  EXPECT_EQ(source_.history().most, 20);
  EXPECT_EQ(source_.history().from_utc_ms, 1500.0);
  EXPECT_EQ(source_.history().to_utc_ms, kEndOfTime_utc_ms);
  const Response unknown = Answer(Get("/api/history?point=nose", cookie));
  EXPECT_EQ(unknown.status, 400);
  EXPECT_EQ(ErrorOf(unknown), "unknown_point");
  EXPECT_EQ(Answer(Get("/api/advance?point=a+b&length_m=0.05", cookie)).status, 400);
  EXPECT_EQ(Answer(Get("/api/advance?point=a+b&length_m=12.5", cookie)).status, 200);
  EXPECT_EQ(source_.advance().point, "a b");
  EXPECT_EQ(source_.advance().length_m, 12.5);
}

TEST_F(Gate, OnlyTheMethodsThatAPlaceHas) {
  for (const char* method :
       {"PUT", "DELETE", "OPTIONS", "TRACE", "CONNECT", "PATCH", "get", "", "POST"}) {
    Request request = Get("/api/snapshot", CookieOf("sue"));
    request.method = method;
    Response response = Answer(request);
    EXPECT_EQ(response.status, 405) << method;
    EXPECT_EQ(Header(response, "Allow"), "GET, HEAD");
    request.target = "/index.html";
    EXPECT_EQ(Answer(request).status, 405) << method;
    request.target = "/nothing";
    EXPECT_EQ(Answer(request).status, 404) << method;
  }
  const Response response = Answer(Get("/api/login"));
  EXPECT_EQ(response.status, 405);
  EXPECT_EQ(Header(response, "Allow"), "POST");
  Request chunked = Get("/healthz");
  chunked.has_transfer_encoding = true;
  EXPECT_EQ(Answer(chunked).status, 400);
}

}  // namespace
}  // namespace tbm::hmi
