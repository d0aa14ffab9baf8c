#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

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

TEST_F(Gate, ThePageComesFromMemoryAndNothingElse) {
  Response page = Answer(Get("/"));
  EXPECT_EQ(page.status, 200);
  EXPECT_EQ(Header(page, "Content-Type"), "text/html; charset=utf-8");
  EXPECT_EQ(Header(page, "Cache-Control"), "no-cache");
  EXPECT_EQ(Body(page), "<!doctype html><title>console</title>");
  EXPECT_EQ(Body(Answer(Get("/index.html"))), Body(page));
  EXPECT_EQ(Body(Answer(Get("/?x=1"))), Body(page));
  for (const char* path : {"/../gate_test.cc",
                           "/..%2fstate/users.json",
                           "/%2e%2e/state/users.json",
                           "/assets/../../state/users.json",
                           "/assets/..\\..\\state\\users.json",
                           "/%252e%252e%252fstate",
                           "//state/users.json",
                           "/./index.html",
                           "/assets",
                           "/assets/",
                           "/index.html/",
                           "/INDEX.HTML",
                           "/index%2ehtml",
                           "/api",
                           "/api/",
                           "/api/me/",
                           "http://127.0.0.1/",
                           "*",
                           ""}) {
    EXPECT_EQ(Answer(Get(path, CookieOf("sue"))).status, 404) << path;
    clock_.Advance(10s);
  }
}

TEST_F(Gate, WhatTheBrowserHasIsNotSentAgain) {
  Request request = Get("/assets/main-1a2b3c4d.js");
  const Response plain = Answer(request);
  EXPECT_EQ(Header(plain, "Cache-Control"), "public, max-age=31536000, immutable");
  EXPECT_EQ(Header(plain, "Vary"), "Accept-Encoding");
  EXPECT_EQ(Body(plain).size(), 5010u);
  request.accept_encoding = "br, gzip;q=0.8";
  const Response zipped = Answer(request);
  EXPECT_EQ(Header(zipped, "Content-Encoding"), "gzip");
  EXPECT_LT(Body(zipped).size(), 200u);
  z_stream stream = {};
  std::string unzipped(6000, '\0');
  ASSERT_EQ(inflateInit2(&stream, 15 + 16), Z_OK);
  std::string packed = Body(zipped);
  stream.next_in = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = reinterpret_cast<Bytef*>(unzipped.data());
  stream.avail_out = static_cast<uInt>(unzipped.size());
  EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
  unzipped.resize(stream.total_out);
  inflateEnd(&stream);
  EXPECT_EQ(unzipped, Body(plain));
  EXPECT_NE(Header(plain, "ETag"), Header(zipped, "ETag"));
  request.accept_encoding = "gzip;q=0";
  EXPECT_EQ(Header(Answer(request), "Content-Encoding"), "");

  request.if_none_match = "\"other\", " + Header(plain, "ETag");
  const Response same = Answer(request);
  EXPECT_EQ(same.status, 304);
  EXPECT_EQ(Body(same), "");
  EXPECT_EQ(Header(same, "ETag"), Header(plain, "ETag"));
  request.if_none_match = "\"other\"";
  EXPECT_EQ(Answer(request).status, 200);
  Request tiny = Get("/assets/tiny-1a2b3c4d.css");
  tiny.accept_encoding = "gzip";
  EXPECT_EQ(Header(Answer(tiny), "Content-Encoding"), "");
}

TEST_F(Gate, AFolderThatIsNoPageIsRefused) {
  EXPECT_THAT(StaticFiles::Read(folder_ / "state").error(), HasSubstr("no index.html"));
  EXPECT_THAT(StaticFiles::Read(folder_ / "none").error(), HasSubstr("cannot be read"));
  std::filesystem::create_symlink("/etc/passwd", folder_ / "web/link");
  EXPECT_THAT(StaticFiles::Read(folder_ / "web").error(), HasSubstr("link: is a link"));
}

TEST_F(Gate, EveryAnswerSaysWhatABrowserMayDo) {
  const std::string head = ResponseHead(Answer(Get("/nothing")), false, true);
  EXPECT_THAT(head, testing::StartsWith("HTTP/1.1 404 Not Found\r\n"));
  EXPECT_THAT(head,
              HasSubstr("\r\nContent-Security-Policy: default-src 'none'; script-src 'self';"));
  EXPECT_THAT(head, Not(HasSubstr("unsafe")));
  EXPECT_THAT(head, HasSubstr("frame-ancestors 'none'"));
  EXPECT_THAT(head, HasSubstr("\r\nX-Content-Type-Options: nosniff\r\n"));
  EXPECT_THAT(head, HasSubstr("\r\nReferrer-Policy: no-referrer\r\n"));
  EXPECT_THAT(head, HasSubstr("\r\nCross-Origin-Opener-Policy: same-origin\r\n"));
  EXPECT_THAT(head, HasSubstr("\r\nCross-Origin-Resource-Policy: same-origin\r\n"));
  EXPECT_THAT(head, HasSubstr("\r\nPermissions-Policy: "));
  EXPECT_THAT(head, Not(HasSubstr("Strict-Transport-Security")));
  EXPECT_THAT(ResponseHead({}, true, true), HasSubstr("\r\nStrict-Transport-Security: max-age="));
  Response split;
  split.Set("X-Name", "a\r\nSet-Cookie: tbm_session=mine");
  split.Set("X-Good", "b");
  const std::string safe = ResponseHead(split, false, false);
  EXPECT_THAT(safe, Not(HasSubstr("Set-Cookie")));
  EXPECT_THAT(safe, HasSubstr("X-Good: b"));
  EXPECT_THAT(safe, HasSubstr("Connection: close\r\n\r\n"));
}

TEST_F(Gate, MetricsAreTheSourcesAndOurs) {
  Answer(LoginAs("otto", "wrong"));
  const std::string text = Body(Answer(Get("/metrics", CookieOf("vera"))));
  EXPECT_THAT(text, HasSubstr("tbm_fake 1\n"));
  EXPECT_THAT(text, HasSubstr("tbm_hmi_logins_total{outcome=\"wrong\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("tbm_hmi_refused_total{reason=\"foreign_origin\"} 0\n"));
}

TEST_F(Gate, TypedNamesCannotForgeLogLines) {
  Answer(LoginAs("x\nlogged_in name=\"otto\"", "wrong"));
  ASSERT_EQ(events_.size(), 1u);
  EXPECT_EQ(events_[0].name, "x?logged_in?name=?otto?");
}

}  // namespace
}  // namespace tbm::hmi
