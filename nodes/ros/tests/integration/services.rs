//! Services and parameters between two nodes over DDS, by both conventions.

use crate::common::{SOON, eventually, free_domain, node, node_with};
use puffer_msgs::rcl_interfaces::msg::{Parameter, ParameterEvent, ParameterType, ParameterValue};
use puffer_msgs::rcl_interfaces::srv;
use puffer_msgs::std_srvs::srv::{SetBool, SetBoolRequest, SetBoolResponse};
use puffer_ros::{CallError, NoParams, Node, QosProfile, RosArgs, ServiceMapping, Stop};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

puffer_core::params! {
    /// For the tests.
    pub struct View("view") {
        /// How far.
        reach: f64 = 0.5, in [0.0, 1.0], unit "m";
        /// How many.
        count: usize = 3, in [1, 10];
    }
}

puffer_core::param_groups! {
    /// For the tests.
    pub struct Params {
        /// What is seen.
        view: View,
    }
}

async fn switch(args: RosArgs, handled: &Arc<AtomicU32>, work: Duration) -> Node<NoParams> {
    let node = node_with::<NoParams>("server", args).await;
    let handled = Arc::clone(handled);
    node.serve::<SetBool, _, _>("switch", move |request| {
        let count = handled.fetch_add(1, Ordering::Relaxed) + 1;
        async move {
            tokio::time::sleep(work).await;
            SetBoolResponse { success: request.data, message: count.to_string() }
        }
    })
    .unwrap();
    node
}

#[tokio::test(flavor = "multi_thread")]
async fn calls_are_answered_at_once_and_at_the_same_time_by_both_conventions() {
    for mapping in [ServiceMapping::Enhanced, ServiceMapping::Cyclone] {
        let args = RosArgs::default().with_domain(free_domain()).with_mapping(mapping);
        let handled = Arc::new(AtomicU32::new(0));
        let _server = switch(args.clone(), &handled, Duration::ZERO).await;
        let caller = node_with::<NoParams>("caller", args.clone()).await;
        let other = node_with::<NoParams>("other", args).await;
        let client = caller.client::<SetBool>("switch").unwrap();
        let second = other.client::<SetBool>("switch").unwrap();
        let calls = (0..8).map(|number| {
            let client = if number % 2 == 0 { client.clone() } else { second.clone() };
            async move {
                let data = number % 3 == 0;
                let answer = client.call(&SetBoolRequest { data }, SOON).await.unwrap();
                assert_eq!(answer.success, data, "{mapping:?}");
            }
        });
        futures::future::join_all(calls).await;
        assert_eq!(handled.load(Ordering::Relaxed), 8, "{mapping:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_slow_first_call_is_repeated_but_handled_once() {
    for mapping in [ServiceMapping::Enhanced, ServiceMapping::Cyclone] {
        let args = RosArgs::default().with_domain(free_domain()).with_mapping(mapping);
        let handled = Arc::new(AtomicU32::new(0));
        // Longer than the first attempts' patience: the request is sent again while it is worked
        // on.
        let _server = switch(args.clone(), &handled, Duration::from_millis(3500)).await;
        let caller = node_with::<NoParams>("caller", args).await;
        let client = caller.client::<SetBool>("switch").unwrap();
        let answer = client.call(&SetBoolRequest { data: true }, SOON).await.unwrap();
        assert_eq!(answer.message, "1");
        let answer = client.call(&SetBoolRequest { data: true }, SOON).await.unwrap();
        assert_eq!((answer.message.as_str(), handled.load(Ordering::Relaxed)), ("2", 2));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_call_that_fails_says_why() {
    let domain = free_domain();
    let args = RosArgs::default().with_domain(domain);
    let caller = node_with::<NoParams>("caller", args.clone()).await;
    let client = caller.client::<SetBool>("switch").unwrap();
    let request = SetBoolRequest { data: true };
    let error = client.call(&request, Duration::from_millis(100)).await.unwrap_err();
    assert!(matches!(error, CallError::NoServer { .. }), "{error}");
    assert!(error.to_string().contains("no server for /switch within 0.1 s"), "{error}");

    let handled = Arc::new(AtomicU32::new(0));
    let server = switch(args.clone(), &handled, Duration::from_secs(3600)).await;
    eventually("the server is matched", || client.is_ready()).await;
    let error = client.call(&request, Duration::from_millis(500)).await.unwrap_err();
    assert!(matches!(error, CallError::NoAnswer { attempts: 1.., .. }), "{error}");

    let call = tokio::spawn({
        let client = client.clone();
        async move { client.call(&SetBoolRequest { data: true }, SOON).await }
    });
    tokio::time::sleep(Duration::from_millis(100)).await;
    server.stop().stop();
    drop(server);
    let error = call.await.unwrap().unwrap_err();
    assert!(matches!(error, CallError::ServerLost { .. }), "{error}");

    let call = tokio::spawn(async move { client.call(&SetBoolRequest { data: true }, SOON).await });
    caller.stop().stop();
    assert!(matches!(call.await.unwrap(), Err(CallError::Stopped { .. })));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_comes_late_or_again_is_found() {
    let args = RosArgs::default().with_domain(free_domain());
    let caller = node_with::<NoParams>("caller", args.clone()).await;
    let client = caller.client::<SetBool>("switch").unwrap();
    for _ in 0..2 {
        let call = tokio::spawn({
            let client = client.clone();
            async move { client.call(&SetBoolRequest { data: true }, SOON).await }
        });
        let server = switch(args.clone(), &Arc::new(AtomicU32::new(0)), Duration::ZERO).await;
        assert!(call.await.unwrap().unwrap().success);
        server.stop().stop();
        drop(server);
        eventually("the server has gone", || !client.is_ready()).await;
    }
}

fn double(name: &str, value: f64) -> Parameter {
    let value = ParameterValue {
        r#type: ParameterType::PARAMETER_DOUBLE,
        double_value: value,
        ..Default::default()
    };
    Parameter { name: name.to_owned(), value }
}

#[tokio::test(flavor = "multi_thread")]
async fn parameters_are_listed_described_read_and_set_with_reasons() {
    let domain = free_domain();
    let args = RosArgs::default().with_domain(domain).with_param("view.count", 5);
    let owner = node_with::<Params>("owner", args).await;
    owner.protect_params(&["view.count"]);
    assert_eq!(owner.params().view.count, 5);
    let user = node::<NoParams>("user", domain).await;
    let mut events =
        user.subscribe::<ParameterEvent>("/parameter_events", QosProfile::Standard).unwrap();

    let list = user.client::<srv::ListParameters>("/owner/list_parameters").unwrap();
    let found = list.call(&Default::default(), SOON).await.unwrap().result;
    assert_eq!(found.names, ["view.reach", "view.count", "use_sim_time"]);
    assert_eq!(found.prefixes, ["view"]);

    let describe = user.client::<srv::DescribeParameters>("/owner/describe_parameters").unwrap();
    let names = vec!["view.reach".to_owned(), "view.count".to_owned()];
    let request = srv::DescribeParametersRequest { names: names.clone() };
    let found = describe.call(&request, SOON).await.unwrap().descriptors;
    assert_eq!(found[0].description, "How far. (m)");
    assert_eq!(found[0].floating_point_range[0].to_value, 1.0);
    assert_eq!((found[1].integer_range[0].from_value, found[1].read_only), (1, true));

    let get = user.client::<srv::GetParameters>("/owner/get_parameters").unwrap();
    let found = get.call(&srv::GetParametersRequest { names }, SOON).await.unwrap().values;
    assert_eq!((found[0].double_value, found[1].integer_value), (0.5, 5));

    let set = user.client::<srv::SetParameters>("/owner/set_parameters").unwrap();
    events.wait_for_writer(SOON).await.unwrap();
    let parameters = vec![
        double("view.reach", 2.0),
        double("view.count", 2.0),
        double("view.speed", 1.0),
        double("view.reach", 0.75),
    ];
    let results = set.call(&srv::SetParametersRequest { parameters }, SOON).await.unwrap().results;
    let reasons =
        ["out of range; allowed are 0 to 1", "read-only", "unknown; view has reach, count"];
    for (result, reason) in results.iter().zip(reasons) {
        assert!(!result.successful && result.reason.contains(reason), "{}", result.reason);
    }
    assert!(results[3].successful);
    assert_eq!(owner.params().view.reach, 0.75);
    let event = events.next_within(SOON).await.unwrap();
    assert_eq!(
        (event.node.as_str(), event.changed_parameters[0].value.double_value),
        ("/owner", 0.75)
    );

    let atomically =
        user.client::<srv::SetParametersAtomically>("/owner/set_parameters_atomically").unwrap();
    let parameters = vec![double("view.reach", 0.1), double("view.reach", 7.0)];
    let request = srv::SetParametersAtomicallyRequest { parameters };
    assert!(!atomically.call(&request, SOON).await.unwrap().result.successful);
    assert_eq!(owner.params().view.reach, 0.75);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_parameter_stops_a_node_before_it_starts() {
    for (name, value, says) in [
        ("view.speed", 1.0, "/owner: parameter view.speed: unknown; view has reach, count"),
        ("view.reach", 3.0, "out of range; allowed are 0 to 1"),
        ("speed", 1.0, "this node has view.reach, view.count, use_sim_time"),
    ] {
        let args = RosArgs::default().with_domain(free_domain()).with_param(name, value);
        let error = match Node::<Params>::start("owner", args, Stop::new()).await {
            Ok(_) => panic!("{name} was taken"),
            Err(error) => format!("{error:#}"),
        };
        assert!(error.contains(says), "{error}");
    }
}
