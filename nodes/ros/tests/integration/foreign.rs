//! Services and topics with endpoints made through ros2-client, whose conventions are another
//! implementation's.

use crate::common::{SOON, free_domain, node_with};
use puffer_msgs::std_msgs::msg::Header;
use puffer_msgs::std_srvs::srv::{SetBool, SetBoolRequest, SetBoolResponse};
use puffer_ros::{NoParams, QosProfile as Profile, RosArgs, ServiceMapping};
use ros2_client::qos::History;
use ros2_client::{
    Context, ContextOptions, MessageTypeName, Name, Node, NodeName, NodeOptions, QosProfile,
    ServiceTypeName,
};
use std::time::Duration;

const MAPPINGS: [(ServiceMapping, ros2_client::ServiceMapping); 2] = [
    (ServiceMapping::Enhanced, ros2_client::ServiceMapping::Enhanced),
    (ServiceMapping::Cyclone, ros2_client::ServiceMapping::Cyclone),
];

fn stranger(domain: u16) -> Node {
    let context = Context::with_options(ContextOptions::new().domain_id(domain)).unwrap();
    let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
    context.new_node(NodeName::new("/", "stranger").unwrap(), options).unwrap()
}

fn quality() -> QosProfile {
    QosProfile::publisher_default().history(History::KeepLast { depth: 10 })
}

fn switch() -> (Name, ServiceTypeName) {
    (Name::new("/", "switch").unwrap(), ServiceTypeName::new("std_srvs", "SetBool"))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_strangers_client_is_answered() {
    for (ours, theirs) in MAPPINGS {
        let domain = free_domain();
        let args = RosArgs::default().with_domain(domain).with_mapping(ours);
        let server = node_with::<NoParams>("server", args).await;
        server
            .serve::<SetBool, _, _>("switch", |request| async move {
                SetBoolResponse { success: request.data, message: "told".to_owned() }
            })
            .unwrap();
        let mut node = stranger(domain);
        let (name, kind) = switch();
        let client = node
            .create_client::<SetBoolRequest, SetBoolResponse>(
                theirs,
                &name,
                &kind,
                quality(),
                quality(),
            )
            .unwrap();
        for data in [true, false] {
            // It asks once only, and its first questions may come before the match.
            let answer = async {
                loop {
                    let call = client.async_call_service(SetBoolRequest { data });
                    match tokio::time::timeout(Duration::from_secs(1), call).await {
                        Ok(answer) => return answer.unwrap(),
                        Err(_) => continue,
                    }
                }
            };
            let answer = tokio::time::timeout(SOON, answer).await.unwrap();
            assert_eq!((answer.success, answer.message.as_str()), (data, "told"), "{ours:?}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_strangers_server_is_asked() {
    for (ours, theirs) in MAPPINGS {
        let domain = free_domain();
        let mut node = stranger(domain);
        let (name, kind) = switch();
        let server = node
            .create_server::<SetBoolRequest, SetBoolResponse>(
                theirs,
                &name,
                &kind,
                quality(),
                quality(),
            )
            .unwrap();
        let answering = tokio::spawn(async move {
            loop {
                let (id, request) = server.async_receive_request().await.unwrap();
                let message = "heard".to_owned();
                let response = SetBoolResponse { success: !request.data, message };
                server.async_send_response(id, response).await.unwrap();
            }
        });
        let args = RosArgs::default().with_domain(domain).with_mapping(ours);
        let caller = node_with::<NoParams>("caller", args).await;
        let client = caller.client::<SetBool>("switch").unwrap();
        for data in [true, false] {
            let answer = client.call(&SetBoolRequest { data }, SOON).await.unwrap();
            assert_eq!((answer.success, answer.message.as_str()), (!data, "heard"), "{ours:?}");
        }
        answering.abort();
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_strangers_publisher_is_heard() {
    let domain = free_domain();
    let mut node = stranger(domain);
    let topic = node
        .create_topic(
            &Name::new("/", "words").unwrap(),
            MessageTypeName::new("std_msgs", "Header"),
            &QosProfile::publisher_default(),
        )
        .unwrap();
    let publisher = node.create_publisher::<Header>(&topic, None).unwrap();
    let listener = node_with::<NoParams>("listener", RosArgs::default().with_domain(domain)).await;
    let mut words = listener.subscribe::<Header>("words", Profile::Sensor).unwrap();
    words.wait_for_writer(SOON).await.unwrap();
    let telling = tokio::spawn(async move {
        loop {
            publisher
                .publish(Header { frame_id: "moon".to_owned(), ..Default::default() })
                .unwrap();
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    });
    assert_eq!(words.next_within(SOON).await.unwrap().frame_id, "moon");
    telling.abort();
}
