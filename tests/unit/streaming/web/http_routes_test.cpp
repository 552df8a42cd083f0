#include <gmock/gmock.h>

#include "streaming/web/http_routes.hpp"
#include "support/noted_setup.hpp"
#include "temporary_page.hpp"

namespace fiducap::web {
namespace {

using testing::HasSubstr;

class HttpRoutesTest : public testing::Test {
 protected:
  HttpResponse get(std::string_view target, std::string_view method = "GET",
                   std::string_view etag = {}) {
    return ask({method, target, etag});
  }
  HttpResponse ask(const HttpRequest& request) {
    return answer(
        request, page_,
        {[] { return make_content("[" + std::string(5000, ' ') + "]", Effort::kQuick); },
         [this] { return health_; }, [](MetricsFormat) { return plain_content("metrics"); },
         [] { return plain_content("views"); }, [] { return plain_content("versions"); },
         [](std::int64_t before, std::int64_t after) -> Expected<std::optional<Content>> {
           if (after > 9) return fail(ErrorCode::kNotFound, "there is no version");
           if (after > 8) return std::nullopt;
           return plain_content(std::to_string(before) + " to " + std::to_string(after));
         }});
  }

  TemporaryPage files_;
  PageFiles page_ = PageFiles::load(files_.root());
  Health health_;
};

TEST_F(HttpRoutesTest, ServeViewsVersionsAndDifferencesOfMaps) {
  EXPECT_EQ(*get("/api/v1/views").body(), "views");
  EXPECT_EQ(*get("/api/v1/map/versions").body(), "versions");
  EXPECT_EQ(*get("/api/v1/map/diff/3/7").body(), "3 to 7");
  EXPECT_EQ(get("/api/v1/map/diff/3/7").content_type, "application/json");
  EXPECT_EQ(get("/api/v1/map/diff/3/9").status, 503) << "being read";
  EXPECT_EQ(get("/api/v1/map/diff/3/9").retry_after_s, 1);
  EXPECT_EQ(get("/api/v1/map/diff/3/12").status, 404);
  for (const char* versions :
       {"", "3", "3/", "/7", "3/7/9", "a/b", "3/7x", "99999999999999999999/1"})
    EXPECT_EQ(get("/api/v1/map/diff/" + std::string(versions)).status, 400) << versions;
}

TEST_F(HttpRoutesTest, HaveContentTypeAndCachingOfTheirContent) {
  const auto index = get("/?lab=1");
  EXPECT_EQ(index.status, 200);
  EXPECT_EQ(index.content_type, "text/html; charset=utf-8");
  EXPECT_EQ(*index.body(), "<!doctype html><title>page</title>");
  EXPECT_EQ(index.cache_control, "no-cache");
  const auto named_by_content = get("/assets/index-1a2b.js");
  EXPECT_EQ(named_by_content.content_type, "text/javascript; charset=utf-8");
  EXPECT_THAT(named_by_content.cache_control, HasSubstr("immutable"));
  const auto state = get("/api/v1/state");
  EXPECT_EQ(state.content_type, "application/json");
  EXPECT_EQ(state.cache_control, "no-store");
}

TEST_F(HttpRoutesTest, OmitTheContentForAKnownEtag) {
  const auto first = get("/");
  const auto again = get("/", "GET", "\"older\", " + first.etag);
  EXPECT_EQ(again.status, 304);
  EXPECT_TRUE(again.body()->empty());
  EXPECT_EQ(get("/", "GET", "\"older\"").status, 200);
}

TEST_F(HttpRoutesTest, LeadToFilesOfThePageOnly) {
  for (const char* target :
       {"/../secret.txt", "/..%2fsecret.txt", "/%2e%2e/secret.txt", "/assets/../../secret.txt",
        "/./../secret.txt", "//etc/passwd", "/etc/passwd", "\\..\\secret.txt", "/assets",
        "/assets/", "", "*", "http://elsewhere/"})
    EXPECT_EQ(get(target).status, 404) << target;
}

TEST_F(HttpRoutesTest, AllowGetAndHeadOnly) {
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS", "TRACE", "<unknown>"})
    EXPECT_EQ(get("/", method).status, 405) << method;
  EXPECT_EQ(get("/", "HEAD").status, 200);
  EXPECT_EQ(get("/api/v1/live").status, 426) << "without an upgrade";
}

TEST_F(HttpRoutesTest, HealthDependsOnTheFramesNotOnAlarms) {
  health_.alarms = {1, 2, 3};
  EXPECT_EQ(get("/healthz").status, 200);
  EXPECT_EQ(*get("/healthz").body(),
            "{\"status\":\"ok\",\"alarms\":{\"error\":3,\"warning\":2,\"info\":1}}\n");
  health_.trouble = "frames stopped";
  EXPECT_EQ(get("/healthz").status, 503);
  EXPECT_THAT(*get("/healthz").body(), HasSubstr("frames stopped"));
}

TEST_F(HttpRoutesTest, ServeMetricsInTheRequestedFormat) {
  EXPECT_EQ(get("/metrics").content_type, "text/plain; version=0.0.4; charset=utf-8");
  const auto open = ask({.method = "GET",
                         .target = "/metrics",
                         .accept = "application/openmetrics-text;version=1.0.0,text/plain;q=0.5"});
  EXPECT_EQ(open.content_type, "application/openmetrics-text; version=1.0.0; charset=utf-8");
}

TEST_F(HttpRoutesTest, ServeTheCompressedFormOnRequestWithItsOwnEtag) {
  files_.write("page/index.html", std::string(5000, 'x'));
  page_ = PageFiles::load(files_.root());
  HttpRequest wanted{.method = "GET", .target = "/", .accept_encoding = "gzip, deflate, br"};
  for (const char* target : {"/api/v1/state", "/"}) {
    const auto plain = get(target);
    EXPECT_FALSE(plain.gzip);
    EXPECT_GE(plain.body()->size(), 5000u);
    wanted.target = target;
    EXPECT_TRUE(ask(wanted).gzip) << target;
    EXPECT_LT(ask(wanted).body()->size(), 200u);
  }
  const std::string tag = ask(wanted).etag;
  EXPECT_NE(tag, get("/").etag);
  wanted.if_none_match = tag;
  EXPECT_EQ(ask(wanted).status, 304);
  EXPECT_EQ(get("/", "GET", tag).status, 200) << "the plain form";
}

TEST_F(HttpRoutesTest, NameTheRemedyForAMissingBundle) {
  page_ = PageFiles::load(files_.root() / "nowhere");
  const auto response = get("/");
  EXPECT_EQ(response.status, 503);
  EXPECT_EQ(response.content_type, "text/html; charset=utf-8");
  EXPECT_THAT(*response.body(), HasSubstr("FIDUCAP_WEB=ON"));
  EXPECT_EQ(get("/api/v1/state").status, 200);
}

TEST(SameOrigin, HoldsForThePageItselfAndWithoutOrigin) {
  for (const auto& [origin, host] :
       std::vector<std::pair<const char*, const char*>>{{"http://hall:8080", "hall:8080"},
                                                        {"http://HALL:8080", "hall:8080"},
                                                        {"http://hall", "hall:80"},
                                                        {"https://hall", "hall"},
                                                        {"http://[::1]:8080", "[::1]:8080"},
                                                        {"http://[::1]", "[::1]:80"},
                                                        {"", "hall:8080"}})
    EXPECT_TRUE(same_origin(origin, host)) << origin;
  for (const char* origin :
       {"http://elsewhere:8080", "http://hall:8081", "http://hall", "null", "hall:8080", "http://",
        "file://hall:8080", "http://hall:8080.elsewhere", "http://hall:8080/"})
    EXPECT_FALSE(same_origin(origin, "hall:8080")) << origin;
}

TEST(OurName, IsAnAddressOrAConfiguredNameAtAnyPort) {
  const std::vector<std::string> names{"Hall", "mocap.example.org"};
  for (const char* host :
       {"", "127.0.0.1", "10.0.0.5:8080", "[::1]:8080", "[fe80::1]", "localhost:8080", "LOCALHOST",
        "hall", "HALL:8080", "hall.local:8080", "mocap.example.org", "mocap.example.org.:80"})
    EXPECT_TRUE(is_our_name(host, names)) << host;
  for (const char* host :
       {"evil.example", "evil.example:8080", "hall.evil.example", "10.0.0.5.evil",
        "localhost.evil.example:80", "xhall", ":8080", "[evil.example]", "[evil.example]:8080",
        "1::%evil.example:8080", "[1::%evil.example]", "[::1", "[::1]evil", "[10.0.0.5]"})
    EXPECT_FALSE(is_our_name(host, names)) << host;
}

class SetupRoutesTest : public testing::Test {
 protected:
  HttpResponse ask(std::string_view method, std::string_view target,
                   std::string_view secret = NotedSetup::kSecret, bool is_here = true) {
    HttpRequest request{method, target};
    request.setup = secret;
    return answer_setup(request, &setup_, is_here);
  }
  NotedSetup setup_;
};

TEST_F(SetupRoutesTest, ServeStateAndPicture) {
  EXPECT_EQ(*ask("GET", "/api/v1/setup").body(), "{}");
  EXPECT_EQ(ask("GET", "/api/v1/setup/picture").status, 404);
  setup_.shown = std::make_shared<const std::string>("jpeg");
  EXPECT_EQ(ask("GET", "/api/v1/setup/picture").content_type, "image/jpeg");
  EXPECT_EQ(ask("GET", "/api/v1/setup/else").status, 404);
}

TEST_F(SetupRoutesTest, ServeTheRequestedSheetOrTheReasonOfARefusal) {
  const auto sheet = ask("GET", "/api/v1/setup/sheet?family=tag36h11&paper=a4");
  EXPECT_EQ(sheet.content_type, "application/pdf");
  EXPECT_EQ(*sheet.body(), "%PDF of tag36h11");
  const auto refused = ask("GET", "/api/v1/setup/sheet?paper=a9");
  EXPECT_EQ(refused.status, 400);
  EXPECT_EQ(*refused.body(), "paper: must be a4\n");
  EXPECT_EQ(ask("GET", "/api/v1/setup/sheet?paper").status, 400);
  EXPECT_EQ(ask("GET", "/api/v1/setup/sheet?paper=a4", NotedSetup::kSecret, false).status, 403);
}

TEST_F(SetupRoutesTest, AcceptCommandsWithTheirValues) {
  EXPECT_EQ(ask("POST", "/api/v1/setup/imu?source=type:+line%0Adevice:%20/dev/tty&part=").status,
            202);
  EXPECT_EQ(setup_.said, "imu");
  EXPECT_EQ(setup_.with.at("source"), "type: line\ndevice: /dev/tty");
  EXPECT_EQ(setup_.with.at("part"), "");
  setup_.is_full = true;
  EXPECT_EQ(ask("POST", "/api/v1/setup/next").status, 503);
}

TEST_F(SetupRoutesTest, ServeThisMachineOnly) {
  EXPECT_EQ(ask("GET", "/api/v1/setup", NotedSetup::kSecret, false).status, 403);
  EXPECT_EQ(ask("POST", "/api/v1/setup/next", NotedSetup::kSecret, false).status, 403);
  EXPECT_EQ(setup_.asked, 0);
  EXPECT_THAT(*ask("GET", "/api/v1/setup", "a guess").body(),
              HasSubstr("fiducapd --setup printed"));
  EXPECT_EQ(*answer_setup({"GET", "/api/v1/setup"}, nullptr, true).body(), "null");
  EXPECT_EQ(answer_setup({"GET", "/api/v1/setup/picture"}, nullptr, true).status, 404);
  EXPECT_EQ(ask("PUT", "/api/v1/setup").status, 405);
}

TEST_F(SetupRoutesTest, RefuseInvalidQueries) {
  for (const char* query : {"?a", "?a=%4", "?a=%zz", "?a=%00", "?a=b&&"})
    EXPECT_EQ(ask("POST", std::string("/api/v1/setup/next") + query).status, 400) << query;
  std::string many = "/api/v1/setup/next?";
  for (int i = 0; i < 20; ++i) many += "k" + std::to_string(i) + "=v&";
  EXPECT_EQ(ask("POST", many).status, 400);
  EXPECT_FALSE(is_setup("/api/v1/setups"));
  EXPECT_TRUE(is_setup("/api/v1/setup/x"));
}

}  // namespace
}  // namespace fiducap::web
