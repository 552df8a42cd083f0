#include "streaming/web/setup_routes.hpp"

#include <gtest/gtest.h>

#include "support/noted_setup.hpp"

namespace fiducap::web {
namespace {

class SetupRoutesTest : public testing::Test {
 protected:
  HttpResponse ask(std::string_view method, std::string_view target,
                   std::string_view secret = NotedSetup::kSecret, bool is_here = true) {
    HttpRequest request{method, target};
    request.setup = secret;
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
  EXPECT_EQ(ask("GET", "/api/v1/setup/sheet?paper=a4", NotedSetup::kSecret, false).status, 403);
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

TEST_F(SetupRoutesTest, ServesThisMachineOnly) {
  EXPECT_EQ(ask("GET", "/api/v1/setup", NotedSetup::kSecret, false).status, 403);
  EXPECT_EQ(ask("POST", "/api/v1/setup/next", NotedSetup::kSecret, false).status, 403);
  EXPECT_EQ(desk_.asked, 0);
  EXPECT_EQ(answer_setup({"GET", "/api/v1/setup"}, nullptr, true).status, 404);
  EXPECT_EQ(ask("PUT", "/api/v1/setup").status, 405);
}

TEST_F(SetupRoutesTest, NoRouteIsReachedWithoutTheSecret) {
  const std::string longer = std::string(NotedSetup::kSecret) + "0";
  ASSERT_GE(setup_routes().size(), 4u);
  for (const SetupRoute& route : setup_routes()) {
    const std::string target =
        "/api/v1/setup/" + std::string(route.what == "*" ? "next" : route.what);
    for (const std::string_view wrong : {std::string_view(""), std::string_view("1"),
                                         NotedSetup::kSecret.substr(1), std::string_view(longer)}) {
      const auto refused = ask(route.method, target, wrong);
      EXPECT_EQ(refused.status, 403) << target << " " << wrong;
      EXPECT_NE(refused.body()->find("fiducapd --setup printed"), std::string::npos);
    }
    EXPECT_EQ(desk_.asked, 0) << target;
    (void)ask(route.method, target + "?paper=a4");
    EXPECT_EQ(std::exchange(desk_.asked, 0), 1) << target << " with the secret";
  }
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
