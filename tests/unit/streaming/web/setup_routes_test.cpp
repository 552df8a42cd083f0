#include "streaming/web/setup_routes.hpp"

#include <gtest/gtest.h>

namespace fiducap::web {
namespace {

class NotedSetup final : public SetupDesk {
 public:
  std::shared_ptr<const std::string> state() const override {
    return std::make_shared<const std::string>("{}");
  }
  std::shared_ptr<const std::string> picture() override { return shown; }
  Expected<void> command(std::string what, std::map<std::string, std::string> values) override {
    if (is_full) return fail(ErrorCode::kUnavailable, "too many commands wait");
    said = std::move(what);
    with = std::move(values);
    return {};
  }

  Expected<std::string> sheet(std::map<std::string, std::string> order) const override {
    if (order["paper"] != "a4") return fail(ErrorCode::kInvalid, "must be a4", "paper");
    return "%PDF of " + order["family"];
  }

  std::shared_ptr<const std::string> shown;
  std::string said;
  std::map<std::string, std::string> with;
  bool is_full{false};
};

class SetupRoutesTest : public testing::Test {
 protected:
  HttpResponse ask(std::string_view method, std::string_view target, std::string_view header = "1",
                   bool is_here = true) {
    HttpRequest request{method, target};
    request.setup = header;
    return answer_setup(request, &desk_, is_here);
  }
  NotedSetup desk_;
};

TEST_F(SetupRoutesTest, ShowsStateAndPicture) {
  EXPECT_EQ(*ask("GET", "/api/v1/setup").body(), "{}");
  EXPECT_EQ(ask("GET", "/api/v1/setup/picture").status, 404);
  desk_.shown = std::make_shared<const std::string>("jpeg");
  EXPECT_EQ(ask("GET", "/api/v1/setup/picture").content_type, "image/jpeg");
  EXPECT_EQ(ask("GET", "/api/v1/setup/else").status, 404);
}

TEST_F(SetupRoutesTest, ServesTheSheetThatIsAskedForOrSaysWhyNot) {
  const auto sheet = ask("GET", "/api/v1/setup/sheet?family=tag36h11&paper=a4");
  EXPECT_EQ(sheet.content_type, "application/pdf");
  EXPECT_EQ(*sheet.body(), "%PDF of tag36h11");
  const auto refused = ask("GET", "/api/v1/setup/sheet?paper=a9");
  EXPECT_EQ(refused.status, 400);
  EXPECT_EQ(*refused.body(), "paper: must be a4\n");
  EXPECT_EQ(ask("GET", "/api/v1/setup/sheet?paper").status, 400);
  EXPECT_EQ(ask("GET", "/api/v1/setup/sheet?paper=a4", "1", false).status, 403);
}

TEST_F(SetupRoutesTest, TakesCommandsWithTheirValues) {
  EXPECT_EQ(ask("POST", "/api/v1/setup/imu?source=type:+line%0Adevice:%20/dev/tty&part=").status,
            202);
  EXPECT_EQ(desk_.said, "imu");
  EXPECT_EQ(desk_.with.at("source"), "type: line\ndevice: /dev/tty");
  EXPECT_EQ(desk_.with.at("part"), "");
  desk_.is_full = true;
  EXPECT_EQ(ask("POST", "/api/v1/setup/next").status, 503);
}

TEST_F(SetupRoutesTest, ServesOnlyThisMachineAndItsOwnPage) {
  EXPECT_EQ(ask("GET", "/api/v1/setup", "1", false).status, 403);
  EXPECT_EQ(ask("POST", "/api/v1/setup/next", "1", false).status, 403);
  EXPECT_EQ(ask("POST", "/api/v1/setup/next", "").status, 403) << "a page from elsewhere";
  EXPECT_EQ(desk_.said, "");
  EXPECT_EQ(answer_setup({"GET", "/api/v1/setup"}, nullptr, true).status, 404);
  EXPECT_EQ(ask("PUT", "/api/v1/setup").status, 405);
}

TEST_F(SetupRoutesTest, RefusesWhatIsNoQuery) {
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
